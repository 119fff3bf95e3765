// SPDX-License-Identifier: BSD-3-Clause
// The world in 3D: shapes come once, poses many times a second. Metres, z up, the simulated world's frame.
import * as THREE from "three";
import {OrbitControls} from "three/controls/OrbitControls.js";
import {TransformControls} from "three/controls/TransformControls.js";

const FIELD_OF_VIEW_DEG = 40;
const TARGET = [0.25, 0, 1.0];
// Where a headset begins: behind the robot, at the height of a head.
const BEHIND = [-0.9, 0, 1.6];
const PLACES = {front: [3.6, 1.2, 1.9], side: [0.25, -3.9, 1.3], top: [0.2, 0, 5.2]};
// Pictures a second at most; and drawing gets this share of the time where no graphics card helps.
const SHORTEST_MS = 33;
const SHARE = 0.33;
// A picture waits that long for an answer that it is to show: without a graphics card, drawing would hold the answer up.
const LONGEST_WAIT_MS = 50;
// A link that holds an arm back: its colour, and what it glows with, since robots may be red themselves.
const HOLDS = 0xd0342c;
const GLOWS = 0xff2a4a;
// Where a hand would be: reached, and the nearest posture of one that is not.
const GHOST = {true: 0x2f9e64, false: 0xd0342c};
const GHOST_OPACITY = 0.5;

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({canvas, antialias: true});
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.05, 60);
    this.camera.up.set(0, 0, 1);
    this.world = new THREE.Group();
    this.hemisphere = new THREE.HemisphereLight(0xffffff, 0x9a9aa0, 2.4);
    this.hemisphere.position.set(0, 0, 1);
    this.sun = new THREE.DirectionalLight(0xffffff, 2.2);
    this.scene.add(this.world, this.hemisphere, this.sun);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxDistance = 15;
    this.controls.minDistance = 0.2;
    this.controls.addEventListener("change", () => this.draw());
    canvas.addEventListener("focus", () => this.controls.listenToKeyEvents(canvas), {once: true});
    this.shapes = new Map();
    this.links = [];
    this.ghosts = new Map();
    this.named = new Map();
    this.marked = new Map();
    this.revision = null;
    this.planned = this.isAsking = this.answered = false;
    this.lastEnd = this.due = this.timer = 0;
    this.cost = 0;
    this.pictures = 0;
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.look("front");
  }

  // Colours of the page: css texts.
  paint(background, lines) {
    this.scene.background = new THREE.Color(background);
    if (this.grid) this.scene.remove(this.grid);
    this.grid = new THREE.GridHelper(6, 12, lines, lines);
    this.grid.rotation.x = Math.PI / 2;
    this.scene.add(this.grid);
    this.draw();
  }

  look(name) {
    this.camera.position.set(...PLACES[name]);
    this.controls.target.set(...TARGET);
    this.controls.update();
    this.draw();
  }

  show(visible) {
    this.world.visible = visible;
    this.draw();
  }

  // The scene's description; content(name) fetches the triangles of a shape: a Float32Array, rows x y z nx ny nz.
  async setScene({revision, bodies, light}, content) {
    const names = new Set(bodies.flatMap((body) => body.links.flat().map((part) => part.shape)));
    await Promise.all([...names].filter((name) => !this.shapes.has(name)).map(async (name) => {
      const rows = new THREE.InterleavedBuffer(await content(name), 6);
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.InterleavedBufferAttribute(rows, 3, 0));
      geometry.setAttribute("normal", new THREE.InterleavedBufferAttribute(rows, 3, 3));
      this.shapes.set(name, geometry);
    }));
    for (const [name, geometry] of this.shapes) {
      if (!names.has(name)) {
        geometry.dispose();
        this.shapes.delete(name);
      }
    }
    for (const name of [...this.ghosts.keys()]) this.removeGhost(name);
    this.world.traverse((object) => object.material?.dispose());
    this.world.clear();
    this.links = bodies.flatMap((body) => body.links.map((parts) => {
      const link = new THREE.Group();
      link.matrixAutoUpdate = false;
      for (const {shape, colour} of parts) link.add(new THREE.Mesh(this.shapes.get(shape), paint(colour)));
      this.world.add(link);
      return link;
    }));
    // Links by their names, and by those of the joints that move them.
    this.named = new Map();
    bodies.flatMap(({names = []}) => names).forEach((pair, number) => {
      for (const name of pair) this.named.set(name, [...this.named.get(name) ?? [], number]);
    });
    this.marked = new Map();
    this.sun.position.set(...light.to_sun).multiplyScalar(5);
    this.revision = revision;
  }

  // Show the links in red that have one of these names, or whose joint has; all others in their own colours.
  mark(names) {
    const wanted = new Set(names.flatMap((name) => this.named.get(name) ?? []));
    if (wanted.size === this.marked.size && [...wanted].every((number) => this.marked.has(number))) return;
    for (const own of this.marked.values()) own.forEach(([material, colour]) => {
      material.color.copy(colour);
      material.emissive.setHex(0);
    });
    this.marked = new Map([...wanted].map((number) => [number, this.links[number].children.map(({material}) => {
      const own = material.color.clone();
      material.color.setHex(HOLDS);
      material.emissive.setHex(GLOWS);
      return [material, own];
    })]));
    this.draw();
  }

  // poses: ArrayBuffer of the revision [uint32] and rows of (3, 4) [float32]. Returns whether they are of this scene.
  setPoses(poses) {
    if (new DataView(poses).getUint32(0, true) !== this.revision) return false;
    const rows = new Float32Array(poses, 4);
    this.links.forEach((link, number) => {
      link.matrix.set(...rows.subarray(12 * number, 12 * number + 12), 0, 0, 0, 1);
      link.matrixWorldNeedsUpdate = true;
    });
    this.draw();
    return true;
  }

  // An arm where it is not, and a handle at its hand that can be dragged. ghost: revision, base and links, poses as 12
  // numbers; hand: position [m] and orientation (x, y, z, w) in the base's frame; dragged(hand).
  showGhost(name, {revision, base, links}, hand, reached, isOld, dragged) {
    if (revision !== this.revision) return;
    const ghost = this.ghosts.get(name) ?? this.makeGhost(name, Object.keys(links), dragged);
    ghost.material.color.setHex(GHOST[reached]);
    ghost.base.matrix.set(...base, 0, 0, 0, 1);
    for (const [number, pose] of Object.entries(links)) ghost.links.get(number).matrix.set(...pose, 0, 0, 0, 1);
    // The hand that is being dragged is where the mouse is.
    if (!ghost.handle.dragging && !isOld) {
      ghost.hand.position.set(...hand.position);
      ghost.hand.quaternion.set(...hand.orientation);
    }
    ghost.group.updateMatrixWorld(true);
    // The handle measures with what it saw at its last update; it may be dragged before the next picture.
    ghost.handle.getHelper().updateMatrixWorld(true);
    this.draw();
  }

  makeGhost(name, numbers, dragged) {
    // Nearer by an offset than it is: a ghost that lies on its arm would otherwise be seen in patches that flicker.
    const material = new THREE.MeshLambertMaterial({
      transparent: true, opacity: GHOST_OPACITY, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -1,
      polygonOffsetUnits: -4});
    const [group, base, hand] = [new THREE.Group(), new THREE.Group(), new THREE.Group()];
    const links = new Map(numbers.map((number) => {
      const link = new THREE.Group();
      for (const part of this.links[number].children) link.add(new THREE.Mesh(part.geometry, material));
      return [number, link];
    }));
    for (const posed of [base, ...links.values()]) posed.matrixAutoUpdate = false;
    base.add(hand);
    group.add(base, ...links.values());
    const handle = new TransformControls(this.camera, this.canvas);
    handle.setSize(0.7);
    this.scene.add(group, handle.getHelper());
    handle.attach(hand);
    handle.addEventListener("change", () => this.draw());
    handle.addEventListener("dragging-changed", ({value}) => { this.controls.enabled = !value; });
    handle.addEventListener("objectChange", () => dragged({
      position: hand.position.toArray(), orientation: hand.quaternion.toArray()}));
    const ghost = {group, base, hand, links, material, handle};
    this.ghosts.set(name, ghost);
    return ghost;
  }

  removeGhost(name) {
    const ghost = this.ghosts.get(name);
    if (!ghost) return;
    this.ghosts.delete(name);
    if (ghost.handle.dragging) this.controls.enabled = true;
    this.scene.remove(ghost.group, ghost.handle.getHelper());
    ghost.handle.dispose();
    ghost.material.dispose();
    this.draw();
  }

  // What dragging a handle does: "translate" along the base's axes, "rotate" about the hand's.
  setDragging(mode) {
    for (const {handle} of this.ghosts.values()) {
      handle.setMode(mode);
      handle.setSpace(mode === "rotate" ? "local" : "world");
    }
  }

  fit() {
    const {clientWidth, clientHeight} = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    // On a narrow screen the whole robot stays in view.
    const narrow = Math.min(1, this.camera.aspect / 0.9);
    this.camera.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(Math.tan(THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG / 2)) / narrow));
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  // Draw soon; nothing is drawn while nothing changes.
  draw() {
    if (this.planned) return;
    this.planned = true;
    this.due = Math.max(performance.now(), this.lastEnd + Math.max(SHORTEST_MS, this.cost / SHARE));
    this.plan();
  }

  plan() {
    clearTimeout(this.timer);
    const time = this.due + (this.isAsking && !this.answered ? LONGEST_WAIT_MS : 0);
    this.timer = setTimeout(() => {
      this.timer = 0;
      requestAnimationFrame(() => this.drawNow());
    }, Math.max(0, time - performance.now()));
  }

  // A question has been asked, or is over. A picture waits for the first answer that comes, and for no later one.
  asks(isAsking) {
    this.answered ||= !isAsking;
    this.isAsking = isAsking;
    if (this.timer) this.plan();
  }

  // A headset draws pictures of its own, from behind the robot's shoulder, and looks ahead as the robot does.
  async enter(session) {
    this.before = this.camera.clone();
    this.rig = new THREE.Group();
    this.rig.position.set(...BEHIND);
    this.rig.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(
      new THREE.Vector3(0, -1, 0), new THREE.Vector3(0, 0, 1), new THREE.Vector3(-1, 0, 0)));
    this.rig.add(this.camera);
    this.scene.add(this.rig);
    this.renderer.xr.enabled = true;
    this.renderer.xr.setReferenceSpaceType("local");
    await this.renderer.xr.setSession(session);
    this.renderer.setAnimationLoop(() => this.renderer.render(this.scene, this.camera));
  }

  leave() {
    this.renderer.setAnimationLoop(null);
    this.renderer.xr.enabled = false;
    this.rig?.removeFromParent();
    this.camera.removeFromParent();
    if (this.before) this.camera.copy(this.before);
    this.fit();
  }

  drawNow() {
    this.planned = false;
    if (this.renderer.xr.isPresenting) return;
    const began = performance.now();
    this.renderer.render(this.scene, this.camera);
    this.lastEnd = performance.now();
    this.cost = this.lastEnd - began;
    this.pictures += 1;
  }
}

function paint([red, green, blue, opacity]) {
  const color = new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace);
  return new THREE.MeshLambertMaterial({color, opacity, transparent: opacity < 1});
}
