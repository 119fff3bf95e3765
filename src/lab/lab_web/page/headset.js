// SPDX-License-Identifier: BSD-3-Clause
// A headset's controllers, or a phone, lead the hands while they are gripped (WebXR).
import {text} from "./texts.js";

const byId = (name) => document.getElementById(name);
// A headset shows the robot; a phone can only add to what its camera sees.
const MODES = ["immersive-vr", "immersive-ar"];
// Buttons of WebXR's standard gamepad: trigger, squeeze, thumbstick, and two more.
const TRIGGER = 0;
const SQUEEZE = 1;
const MARKS = {3: "again", 4: "success", 5: "failure"};

const product = ([ax, ay, az, aw], [bx, by, bz, bw]) => [
  aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
  aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz];
const inverse = ([x, y, z, w]) => [-x, -y, -z, w];
const list = ({x, y, z, w}) => (w === undefined ? [x, y, z] : [x, y, z, w]);
// Where a quaternion's z points.
const backOf = ([x, y, z, w]) => [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];

// WebXR's axes are right, up, back; the base's are ahead, left, up. Ahead is where the user looks.
function toBase(look) {
  const [x, , z] = backOf(look);
  const size = Math.hypot(x, z) || 1;
  const [ahead, across] = [-x / size, -z / size];
  return ([vx, vy, vz]) => [ahead * vx + across * vz, across * vx - ahead * vz, vy];
}

export class Headset {
  // steering: of ./steering.js; send(operation); view: () => the 3D view or null.
  constructor(steering, send, view) {
    Object.assign(this, {steering, send, view, session: null, grips: new Map(), down: new Map(), number: 0});
    byId("steer-headset").onclick = () => (this.session ? this.session.end() : this.enter());
    steering.headset = this;
    this.look();
  }

  async look() {
    const can = await Promise.all(MODES.map((mode) => navigator.xr?.isSessionSupported(mode).catch(() => false)));
    this.mode = MODES.find((mode, number) => can[number]);
    this.refresh();
  }

  refresh() {
    const button = byId("steer-headset");
    button.hidden = !this.mode;
    button.disabled = !this.steering.driving && !this.session;
    button.textContent = text(this.session ? "steer_headset_end" : "steer_headset");
  }

  async enter() {
    const session = await navigator.xr.requestSession(this.mode, {optionalFeatures: ["local-floor"]});
    this.session = session;
    this.taps = new Set();
    session.addEventListener("end", () => this.left());
    session.addEventListener("visibilitychange", () => session.visibilityState !== "visible" && this.letGo());
    // A phone has no buttons: a finger on its screen.
    session.addEventListener("selectstart", ({inputSource}) => this.taps.add(inputSource));
    session.addEventListener("selectend", ({inputSource}) => this.taps.delete(inputSource));
    try {
      await this.view()?.enter(session);
      this.space = await session.requestReferenceSpace("local");
    } catch (error) {
      await session.end();
      throw error;
    }
    session.requestAnimationFrame((_, frame) => this.frame(frame));
    this.refresh();
  }

  left() {
    this.session = null;
    this.letGo();
    this.view()?.leave();
    this.refresh();
  }

  // Nothing is led any more; what is still gripped has to be gripped again.
  letGo() {
    for (const grip of this.grips.values()) grip.ended = true;
    this.steering.lead(new Map());
  }

  frame(frame) {
    if (!this.session) return;
    this.session.requestAnimationFrame((_, next) => this.frame(next));
    const look = frame.getViewerPose(this.space)?.transform.orientation;
    const led = new Map();
    const there = new Set();
    for (const source of this.session.inputSources) {
      const side = this.sideOf(source);
      const buttons = source.gamepad?.buttons ?? [];
      const held = buttons.length > SQUEEZE ? buttons[SQUEEZE].pressed : this.taps.has(source);
      this.press(side, buttons);
      if (!held || !side) {
        this.grips.delete(source);
        continue;
      }
      there.add(source);
      const pose = frame.getPose(source.gripSpace ?? source.targetRaySpace, this.space)?.transform;
      const motion = pose && look && this.motion(source, pose, list(look));
      if (motion) led.set(side, motion);
    }
    for (const source of this.grips.keys()) if (!there.has(source)) this.grips.delete(source);
    this.steering.lead(led);
  }

  sideOf({handedness}) {
    const chosen = this.steering.chosen === "both" ? ["left", "right"] : [this.steering.chosen];
    const side = handedness === "none" ? chosen[0] : handedness;
    return this.steering.sides.includes(side) ? side : "";
  }

  // What a gripped device has done since it was gripped; null for one that was let go from outside.
  motion(source, {position, orientation}, look) {
    const [place, turn] = [list(position), list(orientation)];
    if (!this.grips.has(source)) {
      this.number += 1;
      this.grips.set(source, {number: this.number, place, turn, toBase: toBase(look), ended: !this.steering.ready});
    }
    const grip = this.grips.get(source);
    if (grip.ended) return null;
    const [x, y, z, w] = product(turn, inverse(grip.turn));
    return {number: grip.number, shift: grip.toBase(place.map((value, axis) => value - grip.place[axis])),
      turn: [...grip.toBase([x, y, z]), w]};
  }

  // The trigger closes and opens the gripper in turns; others mark.
  press(side, buttons) {
    buttons.forEach(({pressed}, number) => {
      const key = `${side} ${number}`;
      const {was = false, closed = false} = this.down.get(key) ?? {};
      const fresh = pressed && !was && this.steering.ready;
      const closes = fresh && number === TRIGGER ? !closed : closed;
      this.down.set(key, {was: pressed, closed: closes});
      if (!fresh) return;
      if (number === TRIGGER && side) this.send({op: "grip", side, action: closes ? "close" : "open"});
      if (MARKS[number]) this.send({op: "mark", mark: MARKS[number]});
    });
  }
}
