// SPDX-License-Identifier: BSD-3-Clause
// Sliders, poses, grippers: built from what the server says of the robot.
import {has, text} from "./texts.js";

// A slider follows the joint again when it is this near to what was asked [rad].
const ARRIVED_RAD = 0.02;
// Between two targets of a slider that is being dragged.
const SEND_MS = 50;
// A slider that was moved within this time is still in somebody's hand.
const HELD_MS = 300;

export function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

export class Panel {
  // send(operation); plans: turns a motion into one that is planned, where that is wanted.
  constructor(send, plans) {
    this.send = send;
    this.plans = plans;
    this.sliders = new Map();
    this.wanted = new Map();
    this.unsent = {};
    this.timer = 0;
    this.touched = 0;
    this.enabled = false;
  }

  build({joints = [], poses = [], grippers = []}) {
    this.sliders.clear();
    const groups = new Map();
    for (const joint of joints) {
      const group = joint.name.split("_")[0];
      if (!groups.has(group)) groups.set(group, element("fieldset", {}, element("legend", {textContent: text(group)})));
      groups.get(group).append(this.slider(joint));
    }
    document.getElementById("sliders").replaceChildren(...groups.values());
    document.getElementById("poses").replaceChildren(...poses.map((name) => element("button", {
      id: `pose-${name}`, className: "plain", textContent: has(`pose_${name}`) ? text(`pose_${name}`) : name,
      onclick: () => this.act(this.plans.choose({op: "pose", name}))})));
    const hands = grippers.map((side) => element("p", {className: "row"}, element("span", {textContent: text(`gripper_${side}`)}),
      ...["open", "close", "calibrate"].map((action) => element("button", {
        id: `${side}-${action}`, className: "plain small", textContent: text(action),
        onclick: () => this.act({op: "grip", side, action})}))));
    document.getElementById("grippers").replaceChildren(
      ...(hands.length ? hands : [element("p", {className: "faint", textContent: text("no_grippers")})]));
    this.allow(this.enabled);
  }

  slider({name, lower, upper}) {
    const output = element("output", {textContent: "–"});
    const input = element("input", {type: "range", id: `joint-${name}`, min: lower, max: upper, step: 0.01});
    const label = element("label", {htmlFor: input.id, textContent: name.split("_").slice(1).join("_"), title: name});
    input.setAttribute("aria-label", name);
    input.oninput = () => {
      const target = Math.min(upper, Math.max(lower, input.valueAsNumber));
      this.touched = performance.now();
      this.wanted.set(name, target);
      this.unsent[name] = target;
      output.textContent = shown(target);
      if (!this.timer) this.timer = setTimeout(() => this.sendTargets(), SEND_MS);
    };
    this.sliders.set(name, {input, output});
    return element("div", {className: "joint"}, label, input, output);
  }

  sendTargets() {
    this.timer = 0;
    this.send({op: "move", joints: this.unsent});
    this.unsent = {};
  }

  act(operation) {
    this.settle();
    this.send(operation);
  }

  // Sliders show the joints again, not what was asked.
  settle() {
    this.wanted.clear();
    this.unsent = {};
  }

  // The motion is over, wherever the joints are.
  rested() {
    setTimeout(() => { if (performance.now() - this.touched >= HELD_MS) this.settle(); }, HELD_MS);
  }

  // Positions by joint [rad].
  show(positions) {
    for (const [name, {input, output}] of this.sliders) {
      if (!(name in positions)) continue;
      const wanted = this.wanted.get(name);
      if (wanted !== undefined && Math.abs(positions[name] - wanted) > ARRIVED_RAD) continue;
      this.wanted.delete(name);
      input.value = positions[name];
      output.textContent = shown(positions[name]);
      input.setAttribute("aria-valuetext", output.textContent);
    }
  }

  allow(enabled) {
    this.enabled = enabled;
    for (const control of document.querySelectorAll("#arms input, #arms button, #hands button")) {
      control.disabled = !enabled;
    }
  }
}

// Without the sign of a rounded zero.
const shown = (angle) => `${(Math.round(angle * 100) / 100 + 0).toFixed(2)} rad`;
