// SPDX-License-Identifier: BSD-3-Clause
// What is seen in the 3D view beside the world's bodies: the points of a sensor, and the frames of tf.
import * as THREE from "three";
import {element} from "./panel.js";
import {text} from "./texts.js";

const CLOUD = "sensor_msgs/PointCloud2";
const POINT_M = 0.012;
const AXIS_M = 0.08;
// x red, y green, z blue.
const AXES = [[0.9, 0.15, 0.15], [0.15, 0.7, 0.2], [0.2, 0.4, 0.95]];
const LABEL_M = 0.035;
const LABEL_PIXELS = 28;
// In the place of a revision: the binary message holds points.
const MARK = 0xFFFFFFFF;

export const arePoints = (data) => new DataView(data).getUint32(0, true) === MARK;

export class Overlay {
  // send(operation); view: () => the 3D view or null.
  constructor(send, view) {
    Object.assign(this, {send, view, points: null, frames: null, labels: new Map()});
    this.list = document.getElementById("points");
    this.withFrames = document.getElementById("show-frames");
    this.list.onchange = this.withFrames.onchange = () => this.watch();
  }

  // {topic: type} of what is published.
  listTopics(types) {
    const chosen = this.list.value;
    const topics = Object.keys(types).filter((name) => types[name] === CLOUD).sort();
    this.list.replaceChildren(element("option", {value: "", textContent: text("points_off")}),
      ...topics.map((value) => element("option", {value, textContent: value})));
    this.list.value = topics.includes(chosen) ? chosen : "";
    this.list.hidden = topics.length === 0;
    if (this.list.value !== chosen) this.watch();
  }

  // Tell the server what is wanted; also after a connection was lost.
  watch() {
    if (!this.list.value) this.remove("points");
    if (!this.withFrames.checked) this.remove("frames");
    this.send({op: "watch", points: this.list.value, frames: this.withFrames.checked});
  }

  get isWatching() {
    return Boolean(this.list.value) || this.withFrames.checked;
  }

  // data: MARK, number of points [uint32]; a pose as rows of (3, 4), the points [float32]; their colours [uint8].
  showPoints(data) {
    if (!this.view() || !this.list.value) return;
    const count = new DataView(data).getUint32(4, true);
    this.remove("points");
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(data, 56, 3 * count), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Uint8Array(data, 56 + 12 * count, 3 * count), 3, true));
    const made = new THREE.Points(geometry, new THREE.PointsMaterial({size: POINT_M, vertexColors: true}));
    made.matrixAutoUpdate = false;
    made.matrix.set(...new Float32Array(data, 8, 12), 0, 0, 0, 1);
    this.add("points", made);
  }

  // frames: [name, pose as rows of (3, 4)] of each.
  showFrames(frames) {
    if (!this.view() || !this.withFrames.checked) return;
    const [places, colours] = [[], []];
    const group = new THREE.Group();
    for (const [name, pose] of frames) {
      const [x, y, z] = [pose[3], pose[7], pose[11]];
      AXES.forEach((colour, axis) => {
        places.push(x, y, z, x + AXIS_M * pose[axis], y + AXIS_M * pose[4 + axis], z + AXIS_M * pose[8 + axis]);
        colours.push(...colour, ...colour);
      });
      const label = this.label(name);
      label.position.set(x, y, z);
      group.add(label);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
    geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
    // Frames lie inside of the links.
    group.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({vertexColors: true, depthTest: false})));
    this.remove("frames");
    this.add("frames", group);
  }

  // A name as a picture, made once.
  label(name) {
    if (!this.labels.has(name)) {
      const canvas = document.createElement("canvas");
      const pen = canvas.getContext("2d");
      const font = `${LABEL_PIXELS}px system-ui, sans-serif`;
      pen.font = font;
      Object.assign(canvas, {width: Math.ceil(pen.measureText(name).width) + 8, height: LABEL_PIXELS + 8});
      pen.font = font;
      pen.fillStyle = "#fffc";
      pen.fillRect(0, 0, canvas.width, canvas.height);
      pen.fillStyle = "#1b1f24";
      pen.fillText(name, 4, LABEL_PIXELS);
      const sprite = new THREE.Sprite(new THREE.SpriteMaterial({map: new THREE.CanvasTexture(canvas), depthTest: false}));
      sprite.scale.set(LABEL_M * canvas.width / canvas.height, LABEL_M, 1);
      sprite.center.set(0, 0);
      this.labels.set(name, sprite);
    }
    return this.labels.get(name);
  }

  add(kind, object) {
    this[kind] = object;
    this.view().scene.add(object);
    this.view().draw();
  }

  remove(kind) {
    if (!this[kind]) return;
    this.view().scene.remove(this[kind]);
    this[kind].traverse((part) => {
      if (part.isSprite) return;
      part.geometry?.dispose();
      part.material?.dispose();
    });
    this[kind] = null;
    this.view().draw();
  }
}
