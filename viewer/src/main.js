// The replay page: a building, robots that move in it, and what happened when.
import { explainCell, readScene, robotAt, targetsAt } from "./scene.js";
import { ROBOTS, TARGETS, World } from "./world.js";

const SPEEDS = [0.5, 1, 2, 5, 10, 20, 60, 300];
const MOST_ROWS = 1500; // events shown at once
const DOOR_OPEN = 8; // seconds a door is shown open after a robot opened it

const byId = (id) => document.getElementById(id);
const css = (color) => `#${color.toString(16).padStart(6, "0")}`;

/** An element with text in it; text from the model is never read as markup. */
function make(tag, { text, className, ...attributes } = {}, ...children) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (className) element.className = className;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** A name without what exporters repeat in it: `Sofa:Sofa:123456` is `Sofa`. */
const short = (name) => {
  const parts = [...new Set(name.split(":").map((part) => part.trim()))].filter((part) => part && !/^\d+$/.test(part));
  return parts.join(": ") || name;
};

const metres = (value) => `${(Math.abs(value) < 0.005 ? 0 : value).toFixed(2)} m`;

const clock = (seconds) => {
  const whole = Math.max(0, Math.round(seconds * 10) / 10);
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor((whole % 3600) / 60), whole % 60];
  return `${h ? `${h}:` : ""}${String(m).padStart(2, "0")}:${s.toFixed(1).padStart(4, "0")}`;
};

class Replay {
  constructor(scene) {
    this.scene = scene;
    this.time = scene.span[0];
    this.speed = 5;
    this.playing = false;
    this.selected = null;
    this.world = new World(scene, byId("canvas"));
    document.title = `${scene.title} – bimnav`;
    byId("title").textContent = scene.title;
    byId("subtitle").textContent = scene.subtitle;
    this.levelPanel();
    this.robotPanel();
    this.targetPanel();
    this.eventPanel();
    this.timeline();
    this.pointer();
    this.keyboard();
    new ResizeObserver(() => this.world.resize()).observe(byId("stage"));
    this.world.resize();
    this.showUsed();
    this.seek(this.time);
    requestAnimationFrame((now) => this.frame(now));
  }

  // --- panels

  levelPanel() {
    const list = byId("levels");
    this.scene.levels.forEach((level, index) => {
      const box = make("input", { type: "checkbox", id: `level-${index}` });
      box.checked = true;
      box.addEventListener("change", () => this.world.setLevel(index, box.checked));
      const only = make("button", { text: "only", title: "show this storey alone" });
      only.addEventListener("click", () => this.showOnly(index));
      list.prepend(make("li", {}, box, make("label", { text: level.name, title: level.name, for: `level-${index}` }), make("span", { text: metres(level.z + this.scene.origin[2]), className: "dim" }), only));
    });
    const all = make("button", { text: "all storeys" });
    all.addEventListener("click", () => this.showOnly(null));
    list.append(make("li", {}, all));
    const cut = byId("cut");
    cut.value = String(this.scene.cut ?? 5);
    const tell = () => {
      const value = Number(cut.value) >= 5 ? null : Number(cut.value);
      byId("cut-value").textContent = value === null ? "whole" : `${value.toFixed(1)} m`;
      this.world.setCut(value);
    };
    cut.addEventListener("input", tell);
    tell();
    const explode = byId("explode");
    explode.addEventListener("input", () => {
      byId("explode-value").textContent = `${Number(explode.value).toFixed(0)} m`;
      this.world.setExplode(Number(explode.value));
      this.show();
    });
    if (this.scene.levels.length < 2) byId("explode-row").hidden = true;
    byId("grid").addEventListener("change", (event) => this.overlay("grid", event.target.checked));
    byId("routes").addEventListener("change", (event) => this.overlay("routes", event.target.checked));
    byId("plan").addEventListener("change", (event) => this.setPlan(event.target.checked));
    byId("fit").addEventListener("click", () => this.world.fit());
  }

  /** Hide at first the storeys above all that robots, and targets they reach, are on. */
  showUsed() {
    const reached = this.scene.targets.filter((target) => !target.reason);
    const used = [...reached.map((target) => target.level), ...this.scene.robots.flatMap((robot) => [...robot.level])];
    const highest = Math.max(...used.map((level) => this.scene.levels[level].z), this.scene.levels[0].z);
    this.scene.levels.forEach((level, k) => {
      if (level.z <= highest + 1e-6) return;
      byId(`level-${k}`).checked = false;
      this.world.setLevel(k, false);
    });
  }

  showOnly(index) {
    this.scene.levels.forEach((_, k) => {
      const visible = index === null || index === k;
      byId(`level-${k}`).checked = visible;
      this.world.setLevel(k, visible);
    });
    this.show();
  }

  overlay(name, visible) {
    byId(name).checked = visible;
    for (const level of this.world.levels) level[name].visible = visible;
    this.world.dirty = true;
  }

  setPlan(flat) {
    byId("plan").checked = flat;
    this.world.setFlat(flat);
    byId("stage").classList.toggle("flat", flat);
  }

  robotPanel() {
    this.robotRows = this.scene.robots.map((robot, k) => {
      const swatch = make("span", { className: "swatch" });
      swatch.style.background = css(ROBOTS[k % ROBOTS.length]);
      const status = make("span", { className: "status" });
      const battery = make("meter", { min: 0, max: 1, low: 0.2, high: 0.4, optimum: 1, title: "battery" });
      battery.hidden = !robot.battery;
      const follow = make("button", { text: robot.name, className: "name", title: "look at this robot" });
      follow.addEventListener("click", () => this.look({ robot: robot.name }));
      byId("robots").append(make("li", {}, swatch, follow, status, battery));
      return { status, battery };
    });
    this.labels = this.scene.robots.map((robot) => {
      const label = make("div", { text: robot.name, className: "label" });
      byId("stage").append(label);
      return label;
    });
  }

  targetPanel() {
    this.targetRows = new Map();
    for (const target of this.scene.targets) {
      const swatch = make("span", { className: "swatch round" });
      const state = make("span", { className: "status" });
      const name = make("button", { text: short(target.name) || target.id, title: target.name, className: "name" });
      name.addEventListener("click", () => this.look({ target: target.id }));
      byId("targets").append(make("li", {}, swatch, name, state));
      this.targetRows.set(target.id, { swatch, state });
    }
    byId("target-count").textContent = String(this.scene.targets.length);
  }

  eventPanel() {
    const rows = byId("events");
    this.shownEvents = this.scene.events.slice(0, MOST_ROWS);
    this.eventRows = this.shownEvents.map((event) => {
      const what = `${event.event.replaceAll("_", " ")}${event.name ? ` ${short(event.name)}` : ""}`;
      const button = make("button", { title: [event.name, event.cause].filter(Boolean).join(": ") }, make("time", { text: clock(event.t) }), make("b", { text: event.robot }), make("span", { text: what }));
      button.addEventListener("click", () => this.seek(event.t));
      const row = make("li", {}, button);
      rows.append(row);
      return row;
    });
    if (this.scene.events.length > MOST_ROWS) rows.append(make("li", { text: `and ${this.scene.events.length - MOST_ROWS} more, in events.csv`, className: "dim" }));
    byId("event-count").textContent = String(this.scene.events.length);
    const marks = byId("marks");
    const [from, to] = this.scene.span;
    for (const event of this.scene.events.filter((each) => each.event === "begin_service").slice(0, 400)) {
      const mark = make("i", { title: event.name });
      mark.style.left = `${(100 * (event.t - from)) / Math.max(to - from, 1e-9)}%`;
      marks.append(mark);
    }
  }

  timeline() {
    const scrub = byId("scrub");
    scrub.addEventListener("input", () => this.seek(this.scene.span[0] + Number(scrub.value) * (this.scene.span[1] - this.scene.span[0])));
    byId("play").addEventListener("click", () => this.play(!this.playing));
    const speed = byId("speed");
    for (const value of SPEEDS) speed.append(make("option", { text: `${value}×`, value }));
    speed.value = String(this.speed);
    speed.addEventListener("change", () => (this.speed = Number(speed.value)));
  }

  // --- time

  play(playing) {
    if (playing && this.time >= this.scene.span[1]) this.seek(this.scene.span[0]);
    this.playing = playing;
    byId("play").textContent = playing ? "❚❚" : "▶";
    byId("play").setAttribute("aria-label", playing ? "pause" : "play");
  }

  seek(time) {
    this.time = Math.min(Math.max(time, this.scene.span[0]), this.scene.span[1]);
    this.show();
  }

  step(direction) {
    const times = [...new Set(this.scene.events.map((event) => event.t))];
    const next = direction > 0 ? times.find((t) => t > this.time + 1e-9) : times.findLast((t) => t < this.time - 1e-9);
    if (next !== undefined) this.seek(next);
  }

  show() {
    const { scene, time } = this;
    this.states = scene.robots.map((robot) => robotAt(scene, robot, time));
    this.targets = targetsAt(scene, time);
    const people = scene.people.map((person) => ({ ...person, ...placeAt(person, time) })).filter((person) => person.x !== undefined);
    const doors = scene.events.filter((event) => event.event === "open_door" && event.t <= time && time < event.t + DOOR_OPEN && scene.byId.has(event.target)).map((event) => scene.byId.get(event.target));
    this.world.update(this.states, this.targets, people, [...new Set(doors)]);
    this.states.forEach((state, k) => {
      this.robotRows[k].status.textContent = state.status;
      if (state.battery !== null) this.robotRows[k].battery.value = state.battery;
    });
    for (const [id, row] of this.targetRows) {
      const state = this.targets.get(id);
      row.state.textContent = state;
      row.swatch.style.background = css(TARGETS[state]);
    }
    byId("clock").textContent = `${clock(time - scene.span[0])} / ${clock(scene.span[1] - scene.span[0])}`;
    const share = (time - scene.span[0]) / Math.max(scene.span[1] - scene.span[0], 1e-9);
    if (document.activeElement !== byId("scrub") || this.playing) byId("scrub").value = String(share);
    let current = -1;
    this.shownEvents.forEach((event, k) => (current = event.t <= time + 1e-9 ? k : current));
    if (current !== this.currentEvent) {
      this.eventRows[this.currentEvent]?.classList.remove("current");
      this.eventRows[current]?.classList.add("current");
      const row = this.eventRows[current];
      const list = byId("events");
      if (row && this.playing !== undefined) list.scrollTop = row.offsetTop - list.offsetTop - list.clientHeight / 2;
      this.currentEvent = current;
    }
  }

  frame(now) {
    const passed = Math.min((now - (this.last ?? now)) / 1000, 0.25);
    this.last = now;
    if (this.playing) {
      this.seek(this.time + passed * this.speed);
      if (this.time >= this.scene.span[1]) this.play(false);
    }
    if (this.world.dirty) this.placeLabels();
    this.world.render();
    requestAnimationFrame((next) => this.frame(next));
  }

  placeLabels() {
    this.states.forEach((state, k) => {
      const robot = this.world.robots[k];
      const [x, y, inFront] = this.world.project(robot.position.x, robot.position.y, robot.position.z + this.scene.robots[k].height + 0.15);
      const label = this.labels[k];
      label.hidden = !robot.visible || !inFront;
      label.style.transform = `translate(${x}px, ${y}px) translate(-50%, -100%)`;
    });
  }

  // --- looking closer

  pointer() {
    const canvas = byId("canvas");
    let down = null;
    canvas.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return;
      const box = canvas.getBoundingClientRect();
      this.look(this.world.pick((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height));
    });
    byId("card-close").addEventListener("click", () => this.look(null));
  }

  /** Show the card of a robot, a target, an element or a cell; null for none. */
  look(thing) {
    this.selected = thing;
    this.world.select(null);
    const body = byId("card-body");
    body.replaceChildren();
    byId("card").hidden = !thing;
    if (!thing) return;
    if (thing.robot) this.robotCard(body, thing.robot);
    else if (thing.cell) this.cellCard(body, thing.cell);
    else {
      const target = this.scene.targets.find((each) => each.id === thing.target);
      const index = thing.element ?? this.scene.byId.get(thing.target);
      if (index !== undefined) {
        this.world.select(index);
        this.selected = { ...thing, element: index };
      }
      this.elementCard(body, index === undefined ? target : { ...this.scene.elements[index], ...target });
    }
  }

  table(body, rows) {
    const table = make("table");
    for (const [name, value] of rows) {
      if (value === undefined || value === null || value === "") continue;
      table.append(make("tr", {}, make("th", { text: name }), make("td", { text: String(value) })));
    }
    body.append(table);
  }

  elementCard(body, element) {
    body.append(make("h2", { text: element.name || element.class || element.id }));
    this.table(body, [
      ["class", element.class], ["GlobalId", element.id], ["role", element.role], ["rule", element.rule],
      ["storey", this.scene.levels[element.level]?.name], ["now", this.targets.get(element.id)], ["unreached", element.reason],
    ]);
    for (const [title, rows] of Object.entries(this.scene.facts[element.id] ?? {})) {
      body.append(make("h3", { text: title }));
      this.table(body, Object.entries(rows));
    }
  }

  robotCard(body, name) {
    const k = this.scene.robots.findIndex((robot) => robot.name === name);
    const robot = this.scene.robots[k];
    body.append(make("h2", { text: name }));
    const state = this.states[k];
    const [ox, oy, oz] = this.scene.origin;
    this.table(body, [
      ["status", state.status], ["storey", this.scene.levels[state.level].name],
      ["at", `${(state.x + ox).toFixed(2)}, ${(state.y + oy).toFixed(2)}, ${(state.z + oz).toFixed(2)} m`],
      ["battery", state.battery === null ? null : `${(100 * state.battery).toFixed(0)} %`],
      ["radius", `${robot.radius} m`], ["height", `${robot.height} m`], ["drives", `${robot.distance.toFixed(2)} m in all`],
    ]);
  }

  cellCard(body, [level, row, col]) {
    const why = explainCell(this.scene, level, row, col);
    body.append(make("h2", { text: `cell (${level}, ${row}, ${col})` }));
    this.table(body, [["kind", why.kind], ["storey", this.scene.levels[level].name], ["cost", why.cost === null ? null : Number.isFinite(why.cost) ? why.cost : "no robot goes here"]]);
    if (why.kind === "obstacle" || why.obstacles.length) body.append(make("h3", { text: "touched by" }));
    for (const element of why.obstacles) {
      const button = make("button", { text: `${element.name || element.class} (${element.id})`, className: "name" });
      button.addEventListener("click", () => this.look({ element: this.scene.byId.get(element.id) }));
      body.append(make("p", {}, button, make("span", { text: ` ${element.rule}; ${(element.low + this.scene.origin[2]).toFixed(2)} to ${(element.high + this.scene.origin[2]).toFixed(2)} m`, className: "dim" })));
    }
  }

  keyboard() {
    const keys = {
      " ": () => this.play(!this.playing),
      ArrowRight: () => this.step(1),
      ArrowLeft: () => this.step(-1),
      Home: () => this.seek(this.scene.span[0]),
      End: () => this.seek(this.scene.span[1]),
      "+": () => this.faster(1),
      "-": () => this.faster(-1),
      g: () => this.overlay("grid", !byId("grid").checked),
      r: () => this.overlay("routes", !byId("routes").checked),
      p: () => this.setPlan(!byId("plan").checked),
      f: () => this.world.fit(),
      0: () => this.showOnly(null),
      Escape: () => (byId("help").open ? byId("help").close() : this.look(null)),
      "?": () => byId("help").showModal(),
    };
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
      if (event.key === " " && event.target.tagName === "BUTTON") event.target.blur();
      const level = Number(event.key);
      const action = keys[event.key] ?? (level >= 1 && level <= this.scene.levels.length ? () => this.showOnly(level - 1) : null);
      if (!action) return;
      event.preventDefault();
      action();
    });
    byId("help-open").addEventListener("click", () => byId("help").showModal());
  }

  faster(direction) {
    const index = SPEEDS.indexOf(this.speed) + direction;
    this.speed = SPEEDS[Math.min(Math.max(index, 0), SPEEDS.length - 1)];
    byId("speed").value = String(this.speed);
  }

  /** What the page shows, for tests and for other scripts; coordinates are those of the model. */
  state() {
    const [ox, oy, oz] = this.scene.origin;
    return {
      time: this.time,
      playing: this.playing,
      speed: this.speed,
      plan: this.world.isFlat,
      robots: this.states.map(({ x, y, z, ...rest }) => ({ ...rest, x: x + ox, y: y + oy, z: z + oz, level: this.scene.levels[rest.level].name })),
      targets: Object.fromEntries(this.targets),
      levels: this.world.levels.map(({ level, group }) => ({ name: level.name, visible: group.visible })),
      selected: this.selected && { ...this.selected, id: this.selected.element === undefined ? this.selected.target : this.scene.elements[this.selected.element].id },
      card: byId("card").hidden ? "" : byId("card-body").textContent,
      elements: this.scene.elements.length,
      events: this.scene.events.length,
    };
  }
}

function placeAt(person, time) {
  const { t, x, y } = person;
  if (!t.length || time < t[0] || time > t.at(-1)) return {};
  let k = t.findLastIndex((each) => each <= time);
  k = Math.min(k, t.length - 2);
  if (k < 0) return { x: x[0], y: y[0] };
  const share = (time - t[k]) / Math.max(t[k + 1] - t[k], 1e-9);
  return { x: x[k] + share * (x[k + 1] - x[k]), y: y[k] + share * (y[k + 1] - y[k]) };
}

async function begin() {
  try {
    const replay = new Replay(await readScene(byId("scene")));
    const { scene, world } = replay;
    window.bimnav = {
      seek: (time) => replay.seek(time),
      play: (playing) => replay.play(playing),
      look: (thing) => replay.look(typeof thing === "string" ? { element: scene.byId.get(thing), target: scene.targets.some((t) => t.id === thing) ? thing : undefined } : thing),
      plan: (flat) => replay.setPlan(flat),
      overlay: (name, visible) => replay.overlay(name, visible),
      only: (level) => replay.showOnly(level),
      state: () => replay.state(),
      project: (x, y, z) => world.project(x - scene.origin[0], y - scene.origin[1], z - scene.origin[2]),
    };
    byId("loading").remove();
  } catch (error) {
    byId("loading").textContent = `The page could not be shown: ${error.message}. It needs a browser with WebGL.`;
    throw error;
  }
}

begin();
