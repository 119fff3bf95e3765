// SPDX-License-Identifier: BSD-3-Clause
// Numbers of any topic over time.
import {element} from "./panel.js";
import {COLOURS, drawCurves, listCurves, SPAN_S} from "./plots.js";
import {text} from "./texts.js";

const DRAW_MS = 100;
const PERIOD_MS = 50;
const MAX_FIELDS = 200;
// Messages whose numbers are pictures or clouds.
const LARGE = ["sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/PointCloud2", "sensor_msgs/PointCloud",
               "nav_msgs/OccupancyGrid"];

// The numbers of a message: [name, value]. Entries of arrays are called by the message's list of names, if it has one
// of that length, else by their place.
export function numbersIn(message, path = "", found = [], names = []) {
  const here = [message.name, message.names, message.joint_names].find(Array.isArray) ?? names;
  for (const [key, value] of Object.entries(message)) {
    const label = !Array.isArray(message) ? (path ? `${path}.${key}` : key)
      : `${path}[${names.length === message.length && typeof names[key] === "string" ? names[key] : key}]`;
    if (found.length >= MAX_FIELDS) break;
    if (typeof value === "number" || typeof value === "boolean") found.push([label, Number(value)]);
    else if (value !== null && typeof value === "object" && label !== "header") numbersIn(value, label, found, here);
  }
  return found;
}

export class Numbers {
  // connect(): a new connection to topics.
  constructor(connect) {
    this.connect = connect;
    this.types = {};
    this.topic = "";
    this.rows = [];
    this.part("numbers").addEventListener("toggle", () => this.follow());
    this.part("numbers-topic").onchange = () => this.follow();
  }

  part(name) {
    return document.getElementById(name);
  }

  // {topic: type} of what is published.
  list(types) {
    this.types = Object.fromEntries(Object.entries(types).filter(([, type]) => !LARGE.includes(type)));
    this.part("numbers-topics").replaceChildren(
      ...Object.keys(this.types).sort().map((value) => element("option", {value})));
    this.follow();
  }

  follow() {
    const topic = this.part("numbers").open ? this.part("numbers-topic").value.trim() : "";
    const known = topic in this.types;
    this.part("numbers-said").textContent = !topic || known ? "" : text("numbers_unknown", {text: topic});
    if ((known ? topic : "") === this.topic) return;
    if (this.topic) this.topics.unsubscribe(this.topic);
    clearInterval(this.timer);
    this.topic = known ? topic : "";
    this.rows = [];
    this.part("numbers-fields").replaceChildren();
    if (!this.topic) return;
    this.topics ??= this.connect();
    this.topics.subscribe(topic, this.types[topic], PERIOD_MS, 1, (message) => this.take(topic, message));
    this.timer = setInterval(() => this.draw(), DRAW_MS);
  }

  take(topic, message) {
    if (topic !== this.topic) return;
    const numbers = numbersIn(message);
    const stamp = message.header?.stamp ?? message.stamp;
    const time = stamp?.secs !== undefined ? stamp.secs + stamp.nsecs * 1e-9 : performance.now() / 1000;
    if (time < this.rows.at(-1)?.time) this.rows = [];
    this.rows.push({time, values: new Map(numbers)});
    while (this.rows[0].time < time - SPAN_S) this.rows.shift();
    const list = this.part("numbers-fields");
    const known = new Set([...list.options].map((option) => option.value));
    const fresh = numbers.map(([name]) => name).filter((name) => !known.has(name));
    list.append(...fresh.map((name) => element("option", {value: name, textContent: name})));
    if (!known.size && list.options.length) list.options[0].selected = true;
    if (!list.options.length) this.part("numbers-said").textContent = text("numbers_none");
  }

  draw() {
    const names = [...this.part("numbers-fields").selectedOptions].map((option) => option.value).slice(0, COLOURS.length);
    listCurves(this.part("numbers-key"), names.map((name) => {
      const value = this.rows.at(-1)?.values.get(name);
      return Number.isFinite(value) ? `${name} = ${Number(value.toPrecision(5))}` : name;
    }));
    drawCurves(this.part("numbers-canvas"), names.map((name) => this.rows.map(({time, values}) => [time, values.get(name)])),
               this.rows.at(-1)?.time ?? 0, this.topic);
  }
}
