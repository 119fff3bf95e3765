// SPDX-License-Identifier: BSD-3-Clause
// The simulation: pause, step, reset; objects to add, to move by a handle in the 3D view or by
// numbers, and to delete.
import {element} from "./panel.js";
import {text} from "./texts.js";

// Between two places of an object that is being dragged; and after the last one, when it is looked at again.
const PUT_MS = 80;
const SETTLED_MS = 800;
const HANDLE = "object";
const AXES = ["x", "y", "z"];
const WORLD = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
const byId = (name) => document.getElementById(name);

export class Simulation {
  // send(operation); view: () => the 3D view or null.
  constructor(send, view) {
    Object.assign(this, {send, view, paused: false, allowed: false, held: null, wanted: null, timer: 0, settling: 0});
    byId("pause").onclick = () => send({op: "simulation", do: this.paused ? "go_on" : "pause"});
    byId("step").onclick = () => send({op: "simulation", do: "step"});
    byId("reset").onclick = () => send({op: "simulation", do: "reset"});
    byId("add").onclick = () => send({op: "spawn", name: byId("things").value});
    byId("delete").onclick = () => send({op: "delete", name: byId("objects").value});
    byId("grab").onclick = () => (this.held ? this.letGo() : send({op: "grab", name: byId("objects").value}));
    byId("objects").onchange = () => this.held && send({op: "grab", name: byId("objects").value});
    this.names = [];
    this.inputs = AXES.map((axis) => element("input", {
      type: "number", id: `object-${axis}`, step: 0.01, onchange: () => this.typed()}));
    byId("object-numbers").replaceChildren(...this.inputs.map((input, number) =>
      element("label", {}, `${AXES[number]} [m]`, input)));
  }

  build({has_scene: isSimulated = false, things = []}) {
    byId("simulation").hidden = !isSimulated;
    const chosen = byId("things").value;
    byId("things").replaceChildren(...things.map((name) => element("option", {value: name, textContent: name})));
    if (things.includes(chosen)) byId("things").value = chosen;
    this.refresh();
  }

  // The scene's bodies; those with joints are robots.
  listObjects(bodies) {
    this.names = bodies.filter(({joints, links}) => !joints && links.flat().length).map(({name}) => name);
    const chosen = byId("objects").value;
    byId("objects").replaceChildren(...this.names.map((name) => element("option", {value: name, textContent: name})),
      ...(this.names.length ? [] : [element("option", {value: "", textContent: text("nothing_to_move")})]));
    if (this.names.includes(chosen)) byId("objects").value = chosen;
    this.letGo();
  }

  show({paused}) {
    this.paused = paused;
    this.refresh();
  }

  allow(allowed) {
    this.allowed = allowed;
    if (!allowed) this.letGo();
    this.refresh();
  }

  refresh() {
    byId("pause").textContent = text(this.paused ? "go_on" : "pause");
    for (const name of ["pause", "reset", "add"]) byId(name).disabled = !this.allowed;
    byId("step").disabled = !this.allowed || !this.paused;
    for (const name of ["grab", "delete"]) byId(name).disabled = !this.allowed || !this.names.length;
    byId("grab").setAttribute("aria-pressed", this.held !== null);
    byId("object-place").hidden = this.held === null;
  }

  grabbed({name, position, orientation}) {
    const view = this.view();
    if (!view || view.revision === null || name !== byId("objects").value) return;
    this.held = name;
    this.pose = {position, orientation};
    this.showPlace();
    view.showGhost(HANDLE, {revision: view.revision, base: WORLD, links: {}}, {position, orientation}, true, false,
                   (pose) => this.dragged(pose));
    this.refresh();
  }

  letGo() {
    this.held = this.wanted = null;
    clearTimeout(this.settling);
    this.view()?.removeGhost(HANDLE);
    this.refresh();
  }

  showPlace() {
    this.inputs.forEach((input, number) => {
      if (document.activeElement !== input) input.value = this.pose.position[number].toFixed(3);
    });
  }

  // The numbers as a place, turned as it is; the object's answer shows it and moves the handle there.
  typed() {
    const position = this.inputs.map((input) => input.valueAsNumber);
    if (position.every(Number.isFinite)) this.dragged({...this.pose, position});
  }

  dragged(pose) {
    this.wanted = this.pose = pose;
    this.showPlace();
    if (!this.timer) this.timer = setTimeout(() => this.put(), PUT_MS);
  }

  put() {
    this.timer = 0;
    if (!this.held || !this.wanted) return;
    this.send({op: "put", name: this.held, ...this.wanted});
    this.wanted = null;
    clearTimeout(this.settling);
    this.settling = setTimeout(() => this.held && this.send({op: "grab", name: this.held}), SETTLED_MS);
  }
}
