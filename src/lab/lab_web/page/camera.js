// SPDX-License-Identifier: BSD-3-Clause
// The pictures of one camera, or a line that says what the first one waits for.
import {element} from "./panel.js";
import {text} from "./texts.js";

// Without a picture for so long, the line says why.
const LATE_S = 2;
const LOOK_MS = 1000;
const PERIOD_MS = 66;
const byId = (name) => document.getElementById(name);

export class Camera {
  // state(): {paused, factor}: of the simulation, factor: null where nobody says it.
  constructor(state) {
    Object.assign(this, {state, topics: null, known: [], topic: "", began: 0, timer: 0});
    byId("camera").onchange = () => this.choose(byId("camera").value);
  }

  start(topics) {
    this.topics = topics;
  }

  // known: the topics of cameras that somebody publishes.
  build(known) {
    this.known = known;
    const chosen = byId("camera").value;
    byId("camera").replaceChildren(element("option", {value: "", textContent: text("camera_off")}), ...known.map((topic) =>
      element("option", {value: topic, textContent:
        topic.replace(/^\/cameras\//, "").replace(/\/(image|image_raw)?\/?compressed$/, "")})));
    byId("camera").value = chosen;
    if (byId("camera").value !== chosen) byId("camera").value = "";
    this.say();
  }

  choose(topic) {
    if (this.topic) this.topics.unsubscribe(this.topic);
    clearInterval(this.timer);
    Object.assign(this, {topic, began: performance.now(), timer: 0});
    byId("picture").hidden = true;
    if (topic) {
      this.timer = setInterval(() => this.say(), LOOK_MS);
      byId("picture").alt = text("picture_of", {topic});
      this.topics.subscribe(topic, "sensor_msgs/CompressedImage", PERIOD_MS, 1, (message) => this.show(message));
    }
    this.say();
  }

  show({format, data}) {
    byId("picture").src = `data:image/${format.includes("png") ? "png" : "jpeg"};base64,${data}`;
    byId("picture").hidden = false;
    clearInterval(this.timer);
    this.timer = 0;
    this.say();
  }

  say() {
    byId("picture-said").textContent = this.timer ? this.awaited() : "";
  }

  awaited() {
    const seconds = Math.round((performance.now() - this.began) / 1000);
    const {paused, factor} = this.state();
    if (paused) return text("picture_paused");
    if (seconds < LATE_S) return text("picture_awaited");
    if (!this.known.includes(this.topic)) return text("picture_gone", {seconds});
    return text("picture_late", {seconds, factor: factor === null ? "–" : factor.toFixed(2)});
  }
}
