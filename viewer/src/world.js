// The building in three dimensions.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export const COLORS = {
  wall: 0xe8e6e1, floor: 0xcfcac2, roof: 0xb9aea2, stair: 0xc9b79c, door: 0xb08968, window: 0xa9c7d8,
  structure: 0xb5b5ba, furniture: 0xd6c3a5, services: 0x9fb3a8, other: 0xc7c2cc, target: 0xd55e00,
};
export const ROBOTS = [0x0072b2, 0xd55e00, 0x009e73, 0xcc79a7, 0xe69f00, 0x56b4e9, 0x7f3c8d, 0x5d6d1e];
export const TARGETS = { waiting: 0xd55e00, serving: 0xf0e442, served: 0x009e73, unreached: 0x555555 };
const KINDS = { obstacle: [90, 80, 75, 130], target: [213, 94, 0, 190], regular: [0, 114, 178, 26], outside: [0, 0, 0, 0] };
const SOLID = new Set(["wall", "structure"]); // drawn as cut solids
const ROUTE = 0.06; // metres above the floor
const HALF_ROUTE = 0.035; // metres

export class World {
  constructor(scene, canvas) {
    this.scene = scene;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.localClippingEnabled = true;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.stage = new THREE.Scene();
    this.stage.background = new THREE.Color(0xf7f6f3);
    this.stage.add(new THREE.HemisphereLight(0xffffff, 0x9a948a, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(0.4, -0.7, 1);
    this.stage.add(sun);
    this.spatial = new THREE.PerspectiveCamera(35, 1, 0.05, 5000);
    this.flat = new THREE.OrthographicCamera(-1, 1, 1, -1, -2000, 5000);
    for (const camera of [this.spatial, this.flat]) camera.up.set(0, 0, 1);
    this.flat.up.set(0, 1, 0);
    this.controls = { spatial: new OrbitControls(this.spatial, canvas), flat: new OrbitControls(this.flat, canvas) };
    this.controls.flat.enableRotate = false;
    this.controls.flat.mouseButtons.LEFT = THREE.MOUSE.PAN;
    this.controls.flat.touches.ONE = THREE.TOUCH.PAN;
    this.controls.spatial.maxPolarAngle = Math.PI / 2;
    for (const control of Object.values(this.controls)) control.addEventListener("change", () => (this.dirty = true));
    this.isFlat = false;
    this.explode = 0;
    this.cut = scene.cut;
    const { rows, cols, size } = scene.grid;
    this.coarse = Math.min(Math.hypot(rows * size, cols * size) / 600, 0.25); // metres that one still sees from afar
    this.levels = scene.levels.map((level, index) => this.buildLevel(level, index));
    this.robots = scene.robots.map((robot, index) => this.buildRobot(robot, index));
    this.people = new Map();
    this.selection = null;
    this.dirty = true;
    this.fit();
  }

  buildLevel(level, index) {
    const group = new THREE.Group();
    const plane = new THREE.Plane(new THREE.Vector3(0, 0, -1), 0);
    const { positions, indices, scale, groups } = this.scene.mesh;
    this.positions ??= new THREE.BufferAttribute(positions, 3, true);
    const meshes = [];
    for (const part of groups.filter((each) => each.level === index)) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", this.positions);
      geometry.setIndex(new THREE.BufferAttribute(indices.subarray(3 * part.first, 3 * (part.first + part.count)), 1));
      geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0.5, 0.5, 0.5), 1);
      const glass = part.category === "window";
      const material = new THREE.MeshLambertMaterial({
        color: COLORS[part.category] ?? COLORS.other, flatShading: true, side: SOLID.has(part.category) ? THREE.FrontSide : THREE.DoubleSide, clippingPlanes: [plane],
        transparent: glass, opacity: glass ? 0.45 : 1, polygonOffset: part.category === "floor", polygonOffsetFactor: 1, polygonOffsetUnits: 1,
      });
      const mesh = new THREE.Mesh(geometry, material);
      mesh.scale.set(...scale);
      mesh.frustumCulled = false;
      mesh.userData = part;
      group.add(mesh);
      meshes.push(mesh);
      if (SOLID.has(part.category)) {
        // what one sees of a closed body through a cut are its back faces: dark, they read as the cut itself
        const inside = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: 0x5d574f, side: THREE.BackSide, clippingPlanes: [plane] }));
        inside.scale.copy(mesh.scale);
        inside.frustumCulled = false;
        inside.userData = part;
        group.add(inside);
      }
    }
    const floor = new THREE.Group();
    floor.position.z = level.z;
    group.add(floor);
    for (const room of this.scene.rooms.filter((each) => each.level === index)) floor.add(this.buildRoom(room));
    const grid = this.gridOverlay(index);
    floor.add(grid);
    const routes = new THREE.Group();
    group.add(routes);
    this.scene.robots.forEach((robot, k) => {
      for (const line of robot.routes.filter((each) => each.level === index)) {
        const points = line.points.map(([x, y, z]) => new THREE.Vector3(x, y, z + ROUTE));
        routes.add(ribbon(points, ROBOTS[k % ROBOTS.length], Math.max(HALF_ROUTE, this.coarse)));
      }
    });
    const targets = new Map();
    for (const target of this.scene.targets.filter((each) => each.level === index)) {
      const pin = this.buildTarget(target);
      group.add(pin);
      targets.set(target.id, pin);
    }
    this.stage.add(group);
    return { level, group, plane, meshes, grid, routes, targets };
  }

  buildRoom({ rings }) {
    const path = (ring) => Array.from({ length: ring.length / 2 }, (_, k) => new THREE.Vector2(ring[2 * k], ring[2 * k + 1]));
    const shape = new THREE.Shape(path(rings[0]));
    shape.holes = rings.slice(1).map((ring) => new THREE.Path(path(ring)));
    const sheet = new THREE.Mesh(new THREE.ShapeGeometry(shape), new THREE.MeshBasicMaterial({ color: 0xece7dd, side: THREE.DoubleSide }));
    sheet.position.z = 0.005;
    sheet.userData = {};
    return sheet;
  }

  gridOverlay(index) {
    const { rows, cols, size, x0, y0, kinds } = this.scene.grid;
    const pixels = new Uint8Array(4 * rows * cols);
    for (let k = 0; k < rows * cols; k++) pixels.set(KINDS[this.scene.kinds[kinds[index * rows * cols + k]]], 4 * k);
    const texture = new THREE.DataTexture(pixels, cols, rows);
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.magFilter = texture.minFilter = THREE.NearestFilter;
    texture.needsUpdate = true;
    const sheet = new THREE.Mesh(
      new THREE.PlaneGeometry(cols * size, rows * size),
      new THREE.MeshBasicMaterial({ map: texture, transparent: true, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2 }),
    );
    sheet.position.set(x0 + (cols * size) / 2, y0 + (rows * size) / 2, 0.02);
    sheet.visible = false;
    sheet.userData = { gridLevel: index };
    return sheet;
  }

  buildTarget(target) {
    const group = new THREE.Group();
    const material = new THREE.MeshBasicMaterial({ color: TARGETS.waiting });
    const disc = new THREE.Mesh(new THREE.CylinderGeometry(0.14, 0.14, 0.03, 24).rotateX(Math.PI / 2), material);
    const stem = new THREE.Mesh(new THREE.CylinderGeometry(0.015, 0.015, 0.9, 8).rotateX(Math.PI / 2).translate(0, 0, 0.45), material);
    const head = new THREE.Mesh(new THREE.SphereGeometry(0.09, 16, 12).translate(0, 0, 0.95), material);
    group.add(disc, stem, head);
    group.position.set(target.x, target.y, target.z + 0.03);
    group.userData = { target: target.id, material };
    group.traverse((part) => (part.userData = group.userData));
    return group;
  }

  buildRobot(robot, index) {
    const color = ROBOTS[index % ROBOTS.length];
    const radius = Math.max(robot.radius, 0.12, this.coarse * 2);
    const group = new THREE.Group();
    let body;
    if (robot.outline) {
      const shape = new THREE.Shape(robot.outline.map(([x, y]) => new THREE.Vector2(x, y)));
      body = new THREE.ExtrudeGeometry(shape, { depth: robot.height, bevelEnabled: false });
    } else body = new THREE.CylinderGeometry(radius, radius, robot.height, 32).rotateX(Math.PI / 2).translate(0, 0, robot.height / 2);
    const shell = new THREE.Mesh(body, new THREE.MeshLambertMaterial({ color }));
    const nose = new THREE.Mesh(
      new THREE.ConeGeometry(radius * 0.5, radius, 16).rotateZ(-Math.PI / 2).translate(radius * 0.6, 0, robot.height + 0.02),
      new THREE.MeshBasicMaterial({ color: 0xffffff }),
    );
    group.add(shell, nose);
    group.traverse((part) => (part.userData = { robot: robot.name }));
    this.stage.add(group);
    return group;
  }

  offset(level) {
    return level * this.explode;
  }

  /** Show everything as it is at a time. */
  update(states, targets, people, doors) {
    states.forEach((state, k) => {
      this.robots[k].position.set(state.x, state.y, state.z + this.offset(state.level));
      this.robots[k].rotation.z = state.heading;
      this.robots[k].visible = this.levels[state.level].group.visible;
    });
    for (const level of this.levels) {
      for (const [id, pin] of level.targets) {
        const state = targets.get(id);
        pin.userData.material.color.set(TARGETS[state]);
        pin.scale.setScalar((state === "served" ? 0.6 : 1) * Math.max(1, this.coarse * 12));
      }
    }
    for (const [name, dot] of this.people) dot.visible = people.some((person) => person.name === name);
    for (const person of people) {
      let dot = this.people.get(person.name);
      if (!dot) {
        dot = new THREE.Mesh(new THREE.CapsuleGeometry(person.radius, 1.2, 4, 12).rotateX(Math.PI / 2).translate(0, 0, 0.85), new THREE.MeshLambertMaterial({ color: 0x666666 }));
        this.stage.add(dot);
        this.people.set(person.name, dot);
      }
      dot.position.set(person.x, person.y, this.scene.levels[person.level].z + this.offset(person.level));
      dot.visible = this.levels[person.level].group.visible;
    }
    this.showOpen(doors);
    this.dirty = true;
  }

  showOpen(doors) {
    const key = doors.join();
    if (key === this.openKey) return;
    this.openKey = key;
    for (const mesh of this.open ?? []) mesh.removeFromParent();
    this.open = doors.map((element) => this.copyOf(element, 0x009e73, 0.9)).filter(Boolean);
  }

  copyOf(index, color, opacity) {
    const element = this.scene.elements[index];
    if (!element.count) return null;
    const level = this.levels[element.level];
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", this.positions);
    geometry.setIndex(new THREE.BufferAttribute(this.scene.mesh.indices.subarray(3 * element.first, 3 * (element.first + element.count)), 1));
    geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0.5, 0.5, 0.5), 1);
    const material = new THREE.MeshBasicMaterial({ color, transparent: true, opacity, depthTest: opacity > 0.8, clippingPlanes: [level.plane], side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -1 });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.scale.set(...this.scene.mesh.scale);
    mesh.frustumCulled = false;
    level.group.add(mesh);
    return mesh;
  }

  select(index) {
    this.selection?.removeFromParent();
    this.selection = index === null ? null : this.copyOf(index, 0x0072b2, 0.55);
    this.dirty = true;
  }

  setLevel(index, visible) {
    this.levels[index].group.visible = visible;
    this.dirty = true;
  }

  setExplode(metres) {
    this.explode = metres;
    this.place();
  }

  setCut(metres) {
    this.cut = metres;
    this.place();
  }

  place() {
    this.levels.forEach(({ level, group, plane }, index) => {
      group.position.z = this.offset(index);
      plane.constant = this.cut === null ? 1e6 : level.z + this.cut + this.offset(index);
    });
    this.dirty = true;
  }

  bounds() {
    const box = new THREE.Box3();
    const [w, d, h] = this.scene.mesh.scale;
    const { rows, cols, size, x0, y0 } = this.scene.grid;
    if (this.scene.mesh.indices.length) box.set(new THREE.Vector3(0, 0, 0), new THREE.Vector3(w, d, h));
    const floor = new THREE.Box3(new THREE.Vector3(x0, y0, this.scene.levels[0].z), new THREE.Vector3(x0 + cols * size, y0 + rows * size, this.scene.levels[0].z + 2));
    const most = floor.getSize(new THREE.Vector3()).length() * 3;
    return box.isEmpty() || box.getSize(new THREE.Vector3()).length() > most ? floor : box;
  }

  fit() {
    const box = this.bounds();
    const center = box.getCenter(new THREE.Vector3());
    const size = box.getSize(new THREE.Vector3());
    center.z = box.min.z + 0.2 * size.z;
    const reach = Math.hypot(size.x, size.y, size.z * 0.7) * 1.35;
    this.spatial.position.set(center.x - reach * 0.35, center.y - reach * 0.75, center.z + reach * 0.7);
    this.flat.position.set(center.x, center.y, center.z + 1000);
    for (const control of Object.values(this.controls)) {
      control.target.copy(center);
      control.update();
    }
    this.flat.zoom = 1;
    this.reach = size;
    this.place();
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.renderer.domElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.spatial.aspect = width / height;
    this.spatial.updateProjectionMatrix();
    const half = 0.55 * Math.max(this.reach.y, (this.reach.x * height) / width);
    Object.assign(this.flat, { left: (-half * width) / height, right: (half * width) / height, top: half, bottom: -half });
    this.flat.updateProjectionMatrix();
    this.dirty = true;
  }

  setFlat(flat) {
    this.isFlat = flat;
    this.controls.flat.enabled = flat;
    this.controls.spatial.enabled = !flat;
    this.dirty = true;
  }

  get camera() {
    return this.isFlat ? this.flat : this.spatial;
  }

  /** What lies under a point of the canvas, in -1..1: a robot, a target, an element or a cell. */
  pick(x, y) {
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(x, y), this.camera);
    const things = [...this.robots.filter((robot) => robot.visible)];
    for (const level of this.levels) if (level.group.visible) things.push(level.group);
    for (const hit of ray.intersectObjects(things, true)) {
      const data = hit.object.userData;
      if (data.robot) return { robot: data.robot };
      if (data.target) return { target: data.target };
      if (data.gridLevel !== undefined) {
        if (!hit.object.visible) continue;
        const { size, x0, y0, rows, cols } = this.scene.grid;
        const [row, col] = [Math.floor((hit.point.y - y0) / size), Math.floor((hit.point.x - x0) / size)];
        if (row >= 0 && col >= 0 && row < rows && col < cols) return { cell: [data.gridLevel, row, col] };
      }
      if (data.category) {
        const level = this.levels[data.level];
        if (hit.point.z > level.plane.constant) continue;
        const element = this.scene.elements.findIndex((each) => each.level === data.level && hit.faceIndex + data.first >= each.first && hit.faceIndex + data.first < each.first + each.count);
        if (element >= 0) return { element };
      }
    }
    return null;
  }

  render() {
    if (!this.dirty) return;
    this.dirty = false;
    this.renderer.render(this.stage, this.camera);
  }

  /** Where a point of the world is on the canvas, in pixels. */
  project(x, y, z) {
    const point = new THREE.Vector3(x, y, z).project(this.camera);
    const { clientWidth: width, clientHeight: height } = this.renderer.domElement;
    return [((point.x + 1) / 2) * width, ((1 - point.y) / 2) * height, point.z < 1];
  }
}

/** A flat band along a line, as one mesh. */
function ribbon(points, color, half) {
  const corners = [];
  const across = new THREE.Vector3();
  for (let k = 1; k < points.length; k++) {
    const [a, b] = [points[k - 1], points[k]];
    const length = Math.hypot(b.x - a.x, b.y - a.y);
    if (length < 1e-6) continue;
    across.set(((b.y - a.y) / length) * half, ((a.x - b.x) / length) * half, 0);
    const [p, q, r, t] = [a.clone().add(across), a.clone().sub(across), b.clone().add(across), b.clone().sub(across)];
    for (const corner of [p, r, q, q, r, t]) corners.push(corner.x, corner.y, corner.z);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
  return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide, transparent: true, opacity: 0.8, depthWrite: false }));
}
