// SPDX-License-Identifier: BSD-3-Clause
// The robot's own controls: buttons and wheels, outputs, the head and its screen. What they show is the robot's state.
import {element} from "./panel.js";
import {text} from "./texts.js";

const SIDES = ["left", "right"];
const NAVIGATORS = ["left", "right", "torso_left", "torso_right"];
const STATE_MS = 200;
const SCREEN_MS = 1000;
const SONARS = "/robot/sonar/head_sonar/sonars_enabled";
const DIGITAL = "/robot/digital_io_states";
const ANALOG = "/robot/analog_io_states";
const SCREEN = "/robot/sim/screen";

export class Controls {
  // send(operation); query: the page's token as a query; page(): the page's number; note(code, detail).
  constructor(send, query, page, note) {
    Object.assign(this, {send, query, page, note, allowed: false, canPress: false, topics: null});
    this.hasScreen = false;
    this.buttons = new Map();
    this.wheels = new Map();
    this.outputs = new Map();
    for (const name of ["buttons", "outputs"]) this.part(name).addEventListener("toggle", () => this.follow());
    this.part("screen").addEventListener("toggle", () => this.lookAtScreen());
    const file = this.part("screen-file");
    file.onchange = () => file.files.length && this.showOnScreen(file.files[0]);
    this.part("screen-send").onclick = () => file.click();
    this.part("nod").onclick = () => this.send({op: "nod"});
    this.part("sonars").onchange = ({target}) => this.send({op: "sonars", on: target.checked});
  }

  part(name) {
    return document.getElementById(name);
  }

  build({can_press: canPress = false, has_screen: hasScreen = false}) {
    Object.assign(this, {canPress, hasScreen});
    this.lookAtScreen();
    this.buttons.clear();
    this.wheels.clear();
    const rows = SIDES.map((side) => element("p", {className: "row"}, element("span", {textContent: text(side)}),
      this.button(`${side}_lower_cuff`, "cuff", true),
      ...["lower_button", "upper_button", "shoulder_button"].map((name) => this.button(`${side}_${name}`, name, false))));
    rows.push(...NAVIGATORS.map((name) => element("p", {className: "row"},
      element("span", {textContent: text(`navigator_${name}`)}),
      ...["ok", "back", "show"].map((button) => this.button(`${name}_button_${button}`, `navigator_${button}`, false)),
      this.wheel(`${name}_wheel`))));
    this.part("button-rows").replaceChildren(...rows);
    this.part("no-buttons").hidden = canPress;
    this.allow(this.allowed);
  }

  // A button is pressed as long as the pointer or Enter holds it; one that stays is pressed and released in turns.
  button(name, label, stays) {
    const made = element("button", {id: `press-${name}`, className: "plain small hold", textContent: text(label), title: name});
    made.setAttribute("aria-pressed", false);
    const press = (pressed) => this.send({op: "press", name, pressed});
    if (stays) {
      made.onclick = () => press(made.getAttribute("aria-pressed") !== "true");
    } else {
      let held = false;
      const hold = (is) => {
        if (held !== is) press(held = is);
      };
      made.onpointerdown = (event) => {
        if (made.disabled || event.button !== 0) return;
        made.setPointerCapture(event.pointerId);
        hold(true);
      };
      made.onpointerup = made.onpointercancel = made.onlostpointercapture = made.onblur = () => hold(false);
      // A handler that returns false would keep the Tab key here.
      made.onkeydown = ({key, repeat}) => {
        if (key === "Enter" && !repeat) hold(true);
      };
      made.onkeyup = ({key}) => {
        if (key === "Enter") hold(false);
      };
    }
    this.buttons.set(name, made);
    return made;
  }

  wheel(name) {
    const value = element("output", {textContent: "–", title: name});
    const turn = (steps) => element("button", {
      id: `turn-${name}-${steps > 0 ? "up" : "down"}`, className: "plain small", textContent: steps > 0 ? "+" : "−",
      ariaLabel: text(steps > 0 ? "wheel_up" : "wheel_down"), onclick: () => this.send({op: "turn", name, steps})});
    this.wheels.set(name, value);
    return element("span", {className: "wheel"}, turn(-1), value, turn(1));
  }

  start(topics) {
    this.topics = topics;
    this.follow();
  }

  // States come only while their part is open.
  follow() {
    if (!this.topics) return;
    const open = this.part("buttons").open || this.part("outputs").open;
    if (open === this.follows) return;
    this.follows = open;
    if (!open) {
      for (const topic of [DIGITAL, ANALOG, SONARS]) this.topics.unsubscribe(topic);
      return;
    }
    this.topics.subscribe(DIGITAL, "baxter_core_msgs/DigitalIOStates", STATE_MS, 1, ({names, states}) =>
      names.forEach((name, number) => this.showDigital(name, states[number].state === 1, states[number].isInputOnly)));
    this.topics.subscribe(ANALOG, "baxter_core_msgs/AnalogIOStates", STATE_MS, 1, ({names, states}) =>
      names.forEach((name, number) => this.showAnalog(name, states[number].value, states[number].isInputOnly)));
    this.topics.subscribe(SONARS, "std_msgs/UInt16", STATE_MS, 1, ({data}) => { this.part("sonars").checked = data > 0; });
  }

  showDigital(name, isOn, isInput) {
    this.buttons.get(name)?.setAttribute("aria-pressed", isOn);
    if (isInput) return;
    const box = this.output(name, "checkbox", (input) => input.checked);
    box.checked = isOn;
  }

  showAnalog(name, value, isInput) {
    if (this.wheels.has(name)) this.wheels.get(name).textContent = value;
    if (isInput) return;
    const field = this.output(name, "number", (input) => Math.round(input.valueAsNumber));
    if (document.activeElement !== field) field.value = value;
  }

  output(name, type, value) {
    if (!this.outputs.has(name)) {
      const input = element("input", {type, id: `output-${name}`, disabled: !this.allowed});
      if (type === "number") Object.assign(input, {min: 0, max: 65535});
      input.onchange = () => this.send({op: "output", name, value: value(input)});
      this.outputs.set(name, input);
      this.part("output-list").append(element("label", {className: type}, input, name));
    }
    return this.outputs.get(name);
  }

  allow(allowed) {
    this.allowed = allowed;
    for (const control of document.querySelectorAll("#button-rows button")) control.disabled = !allowed || !this.canPress;
    for (const control of document.querySelectorAll("#output-list input, #sonars, #nod, #screen-send")) {
      control.disabled = !allowed;
    }
  }

  // The picture of the simulated robot's screen; a physical robot does not publish it.
  lookAtScreen() {
    clearInterval(this.timer);
    const picture = this.part("screen-picture");
    if (!this.part("screen").open || !this.hasScreen) {
      picture.hidden = true;
      return;
    }
    const look = () => {
      picture.src = `snapshot${this.query}&topic=${SCREEN}&width=512&height=300&at=${Date.now()}`;
    };
    picture.onload = () => { picture.hidden = false; };
    picture.onerror = () => { picture.hidden = true; };
    this.timer = setInterval(() => picture.complete && look(), SCREEN_MS);
    look();
  }

  // The whole picture, as large as it fits, black around it.
  async showOnScreen(file) {
    const canvas = this.part("screen-canvas");
    const pen = canvas.getContext("2d", {willReadFrequently: true});
    const picture = new Image();
    try {
      picture.src = await new Promise((done, failed) => {
        const reader = Object.assign(new FileReader(), {onload: () => done(reader.result), onerror: failed});
        reader.readAsDataURL(file);
      });
      await picture.decode();
    } catch {
      this.note("no_picture", file.name);
      return;
    } finally {
      this.part("screen-file").value = "";
    }
    const {width, height} = canvas;
    const scale = Math.min(width / picture.width, height / picture.height);
    const [wide, high] = [picture.width * scale, picture.height * scale];
    pen.fillStyle = "#000";
    pen.fillRect(0, 0, width, height);
    pen.drawImage(picture, (width - wide) / 2, (height - high) / 2, wide, high);
    const {data} = pen.getImageData(0, 0, width, height);
    const rows = new Uint8Array(3 * width * height);
    for (let from = 0, to = 0; from < data.length; from += 4, to += 3) {
      rows[to] = data[from];
      rows[to + 1] = data[from + 1];
      rows[to + 2] = data[from + 2];
    }
    const answer = await fetch(`screen${this.query}&page=${this.page()}`, {method: "POST", body: rows});
    if (!answer.ok) this.note("refused", `${answer.status}`);
  }
}
