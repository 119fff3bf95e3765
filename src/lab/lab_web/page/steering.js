// SPDX-License-Identifier: BSD-3-Clause
// Hands that move as long as something is held: a button of the page, a key, a gamepad, a headset's controller. Servos
// move the arms.
import {element} from "./panel.js";
import {text} from "./texts.js";

// Between two messages of what is held, and looks at the gamepads. The server lets go after 300 ms without.
const SEND_MS = 40;
const SIDES = ["left", "right"];
const CHOICES = {left: ["left"], right: ["right"], both: SIDES};
// Each with its row of a twist, its sign, and its key; as in the terminal's keyboard.
const MOTIONS = [
  ["forward", 0, 1, "w"], ["back", 0, -1, "s"], ["to_left", 1, 1, "a"], ["to_right", 1, -1, "d"],
  ["up", 2, 1, "r"], ["down", 2, -1, "f"], ["roll_plus", 3, 1, "u"], ["roll_minus", 3, -1, "o"],
  ["pitch_plus", 4, 1, "k"], ["pitch_minus", 4, -1, "i"], ["yaw_plus", 5, 1, "j"], ["yaw_minus", 5, -1, "l"]];
// The browser's standard gamepad: its buttons; nothing moves unless the right shoulder button is held.
const PAD = {open: 0, close: 1, failure: 2, success: 3, hand: 4, hold: 5, again: 8, tool: 9, up: 12, down: 13, left: 14,
  right: 15};
const MARKS = ["success", "failure", "again"];
const DEAD_ZONE = 0.12;
const FINE = 0;

const byId = (name) => document.getElementById(name);

export class Steering {
  // send(operation); view: () => the 3D view or null.
  constructor(send, view) {
    Object.assign(this, {send, view, topics: null, sides: [], driving: false, chosen: "left", tool: false, padLocked: true});
    this.held = new Map();
    // What a headset leads: side to its motion.
    this.led = new Map();
    this.pressed = new Set();
    this.isMoving = false;
    this.states = Object.fromEntries(SIDES.map((side) => [side, {status: FINE, reason: ""}]));
    byId("steering-open").addEventListener("toggle", () => this.opened());
    byId("steer-speed").oninput = () => this.refresh();
    byId("steer-tool").onchange = ({target}) => {
      this.letGo();
      this.tool = target.checked;
    };
    // Also while a button has the focus: nothing else does.
    addEventListener("keydown", (event) => this.key(event, true));
    addEventListener("keyup", (event) => this.key(event, false));
    // What was held when nobody hears of its release any more.
    for (const name of ["blur", "pagehide", "gamepaddisconnected"]) addEventListener(name, () => this.letGo());
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
    document.addEventListener("focusin", ({target}) => isTyping(target) && this.letGo());
  }

  start(topics) {
    this.topics = topics;
    for (const side of SIDES) this.follow(side);
  }

  get isOpen() {
    return byId("steering-open").open && this.sides.length > 0;
  }

  get speed() {
    return byId("steer-speed").valueAsNumber / 100;
  }

  build({hands = [], servos = []}) {
    byId("steering").hidden = hands.length === 0;
    const lost = this.sides.filter((side) => !servos.includes(side));
    this.sides = servos;
    if (lost.length) this.letGo();
    this.hands = Object.keys(CHOICES).map((name) => element("button", {
      id: `steer-${name}`, className: "plain small", textContent: text(`steer_${name}`), onclick: () => this.choose(name)}));
    byId("steer-hands").replaceChildren(...this.hands);
    this.buttons = MOTIONS.map((motion) => this.button(motion));
    byId("steer-motions").replaceChildren(...this.buttons);
    this.marks = MARKS.map((mark) => element("button", {id: `steer-${mark}`, className: "plain small",
      textContent: text(`steer_${mark}`), onclick: () => this.send({op: "mark", mark})}));
    byId("steer-marks").replaceChildren(...this.marks);
    this.opened();
    this.refresh();
  }

  // Pressed by the pointer or Enter, as long as it holds it.
  button([name, row, sign, key]) {
    const made = element("button", {id: `steer-${name}`, className: "plain small hold"},
      text(`steer_${name}`), " ", element("kbd", {textContent: key}));
    const hold = (is) => {
      if (is && !made.disabled) this.held.set(made.id, [row, sign]);
      else this.held.delete(made.id);
      this.changed();
    };
    made.onpointerdown = (event) => {
      if (event.button !== 0 || made.disabled) return;
      made.setPointerCapture(event.pointerId);
      hold(true);
    };
    for (const end of ["onpointerup", "onpointercancel", "onlostpointercapture", "onblur"]) made[end] = () => hold(false);
    made.onkeydown = ({key: pressed, repeat}) => {
      if (pressed === "Enter" && !repeat) hold(true);
    };
    made.onkeyup = ({key: pressed}) => {
      if (pressed === "Enter") hold(false);
    };
    made.oncontextmenu = (event) => event.preventDefault();
    return made;
  }

  key({key, ctrlKey, altKey, metaKey, repeat, target}, is) {
    const name = key.toLowerCase();
    const motion = MOTIONS.find((one) => one[3] === name);
    if (!is) {
      if (this.held.delete(`key-${name}`)) this.changed();
      return;
    }
    if (!this.isOpen || !this.driving || repeat || ctrlKey || altKey || metaKey || isTyping(target)) return;
    if (name === "h") this.choose(this.nextHand());
    if (name === "t") byId("steer-tool").click();
    if (!motion) return;
    this.held.set(`key-${name}`, motion.slice(1, 3));
    this.changed();
  }

  choose(name) {
    this.letGo();
    this.chosen = name;
    this.refresh();
  }

  nextHand() {
    const names = Object.keys(CHOICES);
    return names[(names.indexOf(this.chosen) + 1) % names.length];
  }

  // Nothing is held any more, whatever the hands still do; a gamepad's hold has to be pressed again.
  letGo() {
    this.held.clear();
    this.led.clear();
    this.padLocked = true;
    for (const grip of this.headset?.grips.values() ?? []) grip.ended = true;
    this.changed();
  }

  // Whether something that is held moves a hand.
  get ready() {
    return this.isOpen && this.driving;
  }

  // A headset leads these hands: {number, shift, turn} each. The timer sends it; letting go must not wait.
  lead(led) {
    const fewer = [...this.led.keys()].some((side) => !led.has(side));
    this.led = led;
    if (fewer || (led.size > 0 && !this.isMoving)) this.changed();
  }

  twist() {
    const twist = [0, 0, 0, 0, 0, 0];
    for (const [row, sign] of this.held.values()) twist[row] += sign;
    const pad = this.pad();
    return twist.map((value, row) => this.speed * Math.max(-1, Math.min(1, value + pad[row])));
  }

  // What the first gamepad wants: six numbers, and its buttons' presses.
  pad() {
    const none = [0, 0, 0, 0, 0, 0];
    const pad = [...navigator.getGamepads?.() ?? []].find((one) => one?.connected && one.mapping === "standard");
    if (!pad || !this.isOpen || !this.driving) return none;
    const down = (name) => pad.buttons[PAD[name]]?.pressed ?? false;
    const now = new Set(Object.keys(PAD).filter(down));
    const before = this.pressed;
    const fresh = (name) => now.has(name) && !before.has(name);
    const [opens, closes, changes, turns] = ["open", "close", "hand", "tool"].map(fresh);
    this.pressed = now;
    if (!now.has("hold")) this.padLocked = false;
    for (const [is, action] of [[opens, "open"], [closes, "close"]]) {
      if (is) for (const side of CHOICES[this.chosen]) this.send({op: "grip", side, action});
    }
    for (const mark of MARKS.filter(fresh)) this.send({op: "mark", mark});
    if (changes) this.choose(this.nextHand());
    if (turns) byId("steer-tool").click();
    if (!now.has("hold") || this.padLocked) return none;
    const [across, along, turn, height] = pad.axes.map((value) => (Math.abs(value) < DEAD_ZONE ? 0 : -value));
    return [along, across, height, now.has("right") - now.has("left"), now.has("up") - now.has("down"), turn];
  }

  // Send what is held, at once and again and again; once nothing when it was let go.
  changed() {
    const twist = this.twist();
    const moves = this.ready && (this.led.size > 0 || twist.some(Boolean));
    const hands = Object.fromEntries(CHOICES[this.chosen].map((side) => [side, twist]));
    if (moves) this.send({op: "steer", tool: this.tool, hands, led: Object.fromEntries(this.led)});
    else if (this.isMoving) this.send({op: "steer", hands: {}});
    this.isMoving = moves;
  }

  opened() {
    clearInterval(this.timer);
    if (!this.isOpen) {
      this.letGo();
    } else {
      this.padLocked = true;
      this.timer = setInterval(() => this.changed(), SEND_MS);
    }
    for (const side of SIDES) this.follow(side);
    this.refresh();
  }

  follow(side) {
    const [status, reason] = ["status", "status_reason"].map((name) => `/${side}_servo/${name}`);
    if (!this.isOpen || !this.sides.includes(side)) {
      this.states[side] = {status: FINE, reason: ""};
      this.topics?.unsubscribe(status);
      this.topics?.unsubscribe(reason);
      return;
    }
    if (!this.topics) return;
    const take = (name) => ({data}) => {
      if (this.states[side][name] === data) return;
      this.states[side][name] = data;
      this.say();
    };
    this.topics.subscribe(status, "std_msgs/Int8", 100, 1, take("status"));
    this.topics.subscribe(reason, "std_msgs/String", 0, 1, take("reason"));
  }

  allow(driving) {
    if (this.driving && !driving) this.letGo();
    this.driving = driving;
    this.refresh();
  }

  refresh() {
    for (const button of [...this.buttons ?? [], ...this.marks ?? []]) button.disabled = !this.driving || !this.sides.length;
    (this.hands ?? []).forEach((button, number) => {
      const name = Object.keys(CHOICES)[number];
      button.disabled = !CHOICES[name].every((side) => this.sides.includes(side));
      button.setAttribute("aria-pressed", name === this.chosen);
    });
    byId("steer-speed-said").textContent = `${byId("steer-speed").value} %`;
    byId("steer-off").hidden = this.sides.length > 0;
    this.headset?.refresh();
    this.say();
  }

  // Beside the robot, and in red on it, what holds the arms back.
  say() {
    const lines = SIDES.filter((side) => this.isOpen && this.sides.includes(side)).map((side) => {
      const {status, reason} = this.states[side];
      const holds = status !== FINE && reason !== "";
      return element("li", {className: holds ? "bad" : "good"},
        `${text(`hand_${side}`)}: ${holds ? reason : text("steer_free")}`);
    });
    byId("steer-state").replaceChildren(...lines);
    byId("steer-state").hidden = lines.length === 0;
    const held = SIDES.filter((side) => this.states[side].status !== FINE);
    const words = held.flatMap((side) => this.states[side].reason.match(/\w+/g) ?? []);
    this.view()?.mark(this.isOpen ? words : []);
  }
}

const TYPED = "select, textarea, input:not([type=checkbox], [type=range])";
const isTyping = (target) => target instanceof Element && target.matches(TYPED);
