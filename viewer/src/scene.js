// The data of the page: what viewer/_scene.py wrote, unpacked.

const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

/** Unpack the scene that the page carries: gzip, base64, JSON. */
export async function readScene(element) {
  const packed = new Blob([bytesOf(element.textContent.trim())]);
  const stream = packed.stream().pipeThrough(new DecompressionStream("gzip"));
  const scene = JSON.parse(await new Response(stream).text());
  scene.mesh.positions = new Uint16Array(bytesOf(scene.mesh.positions).buffer);
  scene.mesh.indices = new Uint32Array(bytesOf(scene.mesh.indices).buffer);
  scene.grid.kinds = bytesOf(scene.grid.kinds);
  if (scene.grid.cost) scene.grid.cost = new Float32Array(bytesOf(scene.grid.cost).buffer);
  scene.byId = new Map(scene.elements.map((element, index) => [element.id, index]));
  scene.robots.forEach((robot) => {
    for (const name of ["t", "x", "y", "z", "heading"]) robot[name] = new Float64Array(bytesOf(robot[name]).buffer);
    for (const name of ["status", "level"]) robot[name] = bytesOf(robot[name]);
  });
  return scene;
}

/** Index of the last entry of a rising array that is not above a value; -1 if all are. */
export function lastAt(values, value) {
  let low = 0;
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

const turned = (from, to, share) => {
  const difference = ((((to - from) % (2 * Math.PI)) + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
  return from + share * difference;
};

/** What a robot does at a time, and where. */
export function robotAt(scene, robot, time) {
  const row = Math.max(lastAt(robot.t, time), 0);
  const next = Math.min(row + 1, robot.t.length - 1);
  const span = robot.t[next] - robot.t[row];
  const share = span > 0 ? Math.min(Math.max((time - robot.t[row]) / span, 0), 1) : 0;
  const between = (values) => values[row] + share * (values[next] - values[row]);
  const battery = robot.battery ? lastAt(robot.battery.t, time) : -1;
  return {
    name: robot.name,
    x: between(robot.x),
    y: between(robot.y),
    z: between(robot.z),
    heading: turned(robot.heading[row], robot.heading[next], robot.x[row] === robot.x[next] && robot.y[row] === robot.y[next] ? share : 0),
    status: time < robot.t[0] ? "idle" : scene.statuses[robot.status[row]],
    level: robot.level[row],
    battery: battery < 0 ? (robot.battery ? 1 : null) : robot.battery.level[battery],
  };
}

/** What has become of every target at a time: waiting, serving, served or unreached. */
export function targetsAt(scene, time) {
  const states = new Map(scene.targets.map((target) => [target.id, "waiting"]));
  const change = { begin_service: "serving", end_service: "served", unreached: "unreached", give_up: "unreached", assign: "waiting" };
  for (const event of scene.events) {
    if (event.t > time) break;
    if (event.target && change[event.event] && states.has(event.target)) states.set(event.target, change[event.event]);
  }
  return states;
}

const insideRings = (rings, x, y) => {
  let inside = false;
  for (const ring of rings) {
    for (let i = 0, j = ring.length - 2; i < ring.length; j = i, i += 2) {
      if (ring[i + 1] > y !== ring[j + 1] > y && x < ((ring[j] - ring[i]) * (y - ring[i + 1])) / (ring[j + 1] - ring[i + 1]) + ring[i]) inside = !inside;
    }
  }
  return inside;
};

const crossesBox = (rings, x0, y0, x1, y1) =>
  rings.some((ring) => {
    for (let i = 0, j = ring.length - 2; i < ring.length; j = i, i += 2) {
      let [low, high] = [0, 1];
      let clear = false;
      for (const [from, to, least, most] of [[ring[j], ring[i], x0, x1], [ring[j + 1], ring[i + 1], y0, y1]]) {
        if (from === to) clear ||= from < least || from > most;
        else {
          const [a, b] = [(least - from) / (to - from), (most - from) / (to - from)].sort((p, q) => p - q);
          low = Math.max(low, a);
          high = Math.min(high, b);
        }
      }
      if (!clear && low < high) return true;
    }
    return false;
  });

/** Why a cell is what it is: its kind, cost, and every obstacle that touches it. */
export function explainCell(scene, level, row, col) {
  const { rows, cols, size, x0, y0, kinds, cost } = scene.grid;
  const index = (level * rows + row) * cols + col;
  const box = [x0 + col * size, y0 + row * size, x0 + (col + 1) * size, y0 + (row + 1) * size];
  const eps = 1e-4;
  const touching = scene.bodies[level].filter(
    ({ rings }) => crossesBox(rings, box[0] + eps, box[1] + eps, box[2] - eps, box[3] - eps) || insideRings(rings, (box[0] + box[2]) / 2, (box[1] + box[3]) / 2),
  );
  return {
    cell: [level, row, col],
    kind: scene.kinds[kinds[index]],
    cost: cost ? cost[index] : null,
    obstacles: touching.map((body) => ({ ...scene.elements[body.element], rule: body.rule, low: body.low, high: body.high })),
  };
}
