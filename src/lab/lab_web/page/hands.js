// SPDX-License-Identifier: BSD-3-Clause
// Where a hand is to go: dragged in the 3D view, or typed; the server says whether the arm gets there.
import {element} from "./panel.js";
import {has, text} from "./texts.js";

// A question that is not answered: another one may be asked.
const LOST_MS = 2000;
const FIELDS = ["x", "y", "z", "roll", "pitch", "yaw"];
const degrees = (angle) => angle * 180 / Math.PI;
const radians = (angle) => angle * Math.PI / 180;

export class Hands {
  // send(operation); view: () => the 3D view or null; plans: turns a motion into one that is planned.
  constructor(send, view, plans) {
    this.send = send;
    this.plans = plans;
    this.view = view;
    this.hands = new Map();
    this.mode = "translate";
    this.driving = this.acting = false;
  }

  build(sides) {
    this.clear();
    this.hands = new Map(sides.map((side) => [side, new Hand(this, side)]));
    const modes = ["translate", "rotate"].map((mode) => element("button", {
      className: "plain small", textContent: text(`drag_${mode}`), onclick: () => this.setMode(mode)}));
    this.modes = modes;
    const go = element("button", {id: "reach-go", className: "plain", textContent: text("go"), onclick: () => this.go()});
    this.goButton = go;
    document.getElementById("reach-hands").replaceChildren(
      element("p", {className: "row"}, ...[...this.hands.values()].map((hand) => hand.toggle), ...modes, go),
      ...[...this.hands.values()].map((hand) => hand.fields));
    document.getElementById("reach").hidden = sides.length === 0;
    this.setMode(this.mode);
    this.refresh();
  }

  setMode(mode) {
    this.mode = mode;
    this.modes.forEach((button, number) => button.setAttribute("aria-pressed", mode === ["translate", "rotate"][number]));
    this.view()?.setDragging(mode);
  }

  // acting: this address may move the robot; driving: this page has the control.
  allow(acting, driving) {
    Object.assign(this, {acting, driving});
    if (!acting) this.clear();
    this.refresh();
  }

  refresh() {
    for (const hand of this.hands.values()) hand.refresh(this.acting);
    const shown = [...this.hands.values()].filter((hand) => hand.shown);
    if (this.goButton) this.goButton.disabled = !this.driving || !shown.length || !shown.every((hand) => hand.reaches);
  }

  // All hands that are shown, together.
  go() {
    const shown = [...this.hands.values()].filter((hand) => hand.shown && hand.reaches);
    this.send(this.plans.choose({op: "go", joints: Object.assign({}, ...shown.map((hand) => hand.joints))}));
  }

  answered(answer) {
    this.hands.get(answer.side)?.answered(answer);
    this.refresh();
  }

  clear() {
    for (const hand of this.hands.values()) hand.hide();
  }
}

class Hand {
  constructor(hands, side) {
    this.hands = hands;
    this.side = side;
    this.shown = this.reaches = false;
    this.joints = {};
    this.number = 0;
    this.asked = this.wanted = null;
    this.timer = 0;
    this.toggle = element("button", {
      id: `reach-${side}`, className: "plain", textContent: text(`hand_${side}`),
      onclick: () => (this.shown ? this.hide() : this.show())});
    this.inputs = FIELDS.map((name, number) => element("input", {
      type: "number", id: `reach-${side}-${name}`, step: number < 3 ? 0.01 : 5,
      onchange: () => this.typed()}));
    const back = element("button", {
      className: "plain small", textContent: text("hand_back"), onclick: () => this.ask({})});
    this.said = element("p", {className: "reason"});
    this.said.setAttribute("role", "status");
    this.fields = element("fieldset", {className: "hand", hidden: true},
      element("legend", {textContent: text(`hand_${side}`)}),
      element("p", {className: "numbers"}, ...this.inputs.map((input, number) =>
        element("label", {}, `${FIELDS[number]} [${number < 3 ? "m" : "°"}]`, input))),
      element("p", {className: "row"}, back), this.said);
  }

  refresh(acting) {
    this.toggle.disabled = !acting;
    this.toggle.setAttribute("aria-pressed", this.shown);
  }

  show() {
    this.shown = true;
    this.ask({});
    this.hands.refresh();
  }

  hide() {
    Object.assign(this, {shown: false, reaches: false, asked: null, wanted: null});
    clearTimeout(this.timer);
    this.number += 1;
    this.fields.hidden = true;
    this.hands.view()?.asks(false);
    this.hands.view()?.removeGhost(this.side);
    this.hands.refresh();
  }

  // One question at a time; the newest wish is the next one, as soon as there is an answer.
  ask(question) {
    this.wanted = question;
    if (this.asked === null) this.askNow();
  }

  askNow() {
    clearTimeout(this.timer);
    this.asked = null;
    this.hands.view()?.asks(Boolean(this.wanted));
    if (!this.wanted) return;
    this.asked = performance.now();
    this.number += 1;
    this.hands.send({op: "reach", side: this.side, number: this.number, ...this.wanted});
    this.wanted = null;
    this.timer = setTimeout(() => this.askNow(), LOST_MS);
  }

  answered(answer) {
    if (answer.number !== this.number || !this.shown) return;
    this.take(answer);
    this.hands.view()?.asks(false);
    this.askNow();
  }

  take({why, text: detail, joints, position, orientation, ghost}) {
    this.reaches = why === "" && !this.wanted;
    this.said.textContent = why === "" ? text("reach_yes")
      : text(has(`reach_${why}`) ? `reach_${why}` : "refused", {text: detail});
    this.said.classList.toggle("bad", why !== "");
    this.fields.hidden = false;
    if (!joints) return;
    this.joints = joints;
    if (!this.wanted && !this.inputs.includes(document.activeElement)) this.fill(position, orientation);
    const view = this.hands.view();
    if (view && ghost) {
      view.showGhost(this.side, ghost, {position, orientation}, why === "", this.wanted !== null,
                     (pose) => this.dragged(pose));
      view.setDragging(this.hands.mode);
    }
  }

  dragged(pose) {
    this.fill(pose.position, pose.orientation);
    this.ask(pose);
  }

  fill(position, orientation) {
    const turned = angles(orientation).map(degrees);
    [...position, ...turned].forEach((value, number) => {
      this.inputs[number].value = (Math.round(value * 1000) / 1000 + 0).toFixed(number < 3 ? 3 : 1);
    });
  }

  typed() {
    const values = this.inputs.map((input) => input.valueAsNumber);
    if (!values.every(Number.isFinite)) return;
    this.ask({position: values.slice(0, 3), orientation: quaternion(values.slice(3).map(radians))});
  }
}

// Roll, pitch and yaw about fixed x, y, z [rad], as in descriptions, from x y z w and back.
function angles([x, y, z, w]) {
  const sine = Math.max(-1, Math.min(1, 2 * (w * y - z * x)));
  return [Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), Math.asin(sine),
          Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))];
}

function quaternion([roll, pitch, yaw]) {
  const [a, b, c] = [Math.cos(roll / 2), Math.cos(pitch / 2), Math.cos(yaw / 2)];
  const [d, e, f] = [Math.sin(roll / 2), Math.sin(pitch / 2), Math.sin(yaw / 2)];
  return [d * b * c - a * e * f, a * e * c + d * b * f, a * b * f - d * e * c, a * b * c + d * e * f];
}
