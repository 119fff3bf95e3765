// SPDX-License-Identifier: BSD-3-Clause
// Position, velocity and effort of the joints of one part of the robot over time.
import {element} from "./panel.js";
import {text} from "./texts.js";

export const SPAN_S = 15;
const DRAW_MS = 100;
const QUANTITIES = [["position", "rad"], ["velocity", "rad/s"], ["effort", "Nm"]];
// Distinct on light and on dark ground.
export const COLOURS = ["#d1495b", "#2a7fba", "#2e9e6b", "#c77d0a", "#8a5bc4", "#13939c", "#a0661f"];
const MARGIN = {left: 46, right: 6, top: 16, bottom: 4};

export class Plots {
  constructor() {
    this.part = document.getElementById("plot-part");
    this.rows = [];
    this.timer = 0;
    this.details = document.getElementById("plots");
    this.part.onchange = () => this.draw();
    this.details.addEventListener("toggle", () => {
      clearInterval(this.timer);
      if (this.details.open) this.timer = setInterval(() => this.draw(), DRAW_MS);
    });
  }

  build(joints) {
    const chosen = this.part.value;
    const parts = [...new Set(joints.map(({name}) => name.split("_")[0]))];
    this.part.replaceChildren(...parts.map((part) => element("option", {value: part, textContent: text(part)})));
    this.part.value = parts.includes(chosen) ? chosen : parts[0] ?? "";
    this.names = joints.map(({name}) => name);
  }

  // A joint_states message; it may hold only some of the joints.
  take({header, name, ...values}) {
    const time = header.stamp.secs + header.stamp.nsecs * 1e-9;
    const last = this.rows.at(-1)?.time;
    if (time < last) this.rows = [];
    this.rows.push({time, values: new Map(name.map((joint, number) =>
      [joint, QUANTITIES.map(([quantity]) => values[quantity][number])]))});
    while (this.rows[0].time < time - SPAN_S) this.rows.shift();
  }

  draw() {
    const joints = (this.names ?? []).filter((name) => name.startsWith(`${this.part.value}_`));
    listCurves(document.getElementById("plot-key"), joints.map((joint) => joint.split("_").slice(1).join("_")));
    QUANTITIES.forEach(([quantity, unit], number) => drawCurves(
      document.getElementById(`plot-${quantity}`),
      joints.map((joint) => this.rows.map(({time, values}) => [time, values.get(joint)?.[number]])),
      this.rows.at(-1)?.time ?? 0, `${text(`plot_${quantity}`)} [${unit}]`));
  }
}

// Curves over the last SPAN_S seconds before `now`; curves: rows of [time, value], values that are no numbers left out.
export function drawCurves(canvas, curves, now, title) {
  const style = getComputedStyle(document.documentElement);
  const scale = Math.min(devicePixelRatio, 2);
  const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
  if (!wide) return;
  if (canvas.width !== Math.round(wide * scale)) Object.assign(canvas, {width: wide * scale, height: high * scale});
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, wide, high);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = style.getPropertyValue("--faint").trim();
  pen.fillText(title, MARGIN.left, 11);
  const finite = curves.map((curve) => curve.filter(([, value]) => Number.isFinite(value)));
  const all = finite.flat().map(([, value]) => value);
  if (!all.length) return;
  let [low, top] = [Math.min(...all), Math.max(...all)];
  const least = 0.02;
  if (top - low < least) [low, top] = [(low + top - least) / 2, (low + top + least) / 2];
  const x = (time) => wide - MARGIN.right - (now - time) / SPAN_S * (wide - MARGIN.left - MARGIN.right);
  const y = (value) => MARGIN.top + (top - value) / (top - low) * (high - MARGIN.top - MARGIN.bottom);
  pen.strokeStyle = style.getPropertyValue("--edge").trim();
  pen.lineWidth = 1;
  for (const value of [low, (low + top) / 2, top]) {
    pen.beginPath();
    pen.moveTo(MARGIN.left, y(value));
    pen.lineTo(wide - MARGIN.right, y(value));
    pen.stroke();
    pen.fillText(short(value, top - low), 2, Math.min(high - 2, y(value) + 4));
  }
  pen.lineWidth = 1.5;
  finite.forEach((curve, number) => {
    pen.strokeStyle = COLOURS[number % COLOURS.length];
    pen.beginPath();
    curve.forEach(([time, value]) => pen.lineTo(x(time), y(value)));
    pen.stroke();
  });
}

function short(value, span) {
  return Math.abs(value) >= 1e5 ? value.toExponential(1) : value.toFixed(span < 1 ? 3 : 1);
}

// The names of curves in their colours.
export function listCurves(list, names) {
  list.replaceChildren(...names.map((name, number) => {
    const label = element("li", {textContent: name});
    label.style.setProperty("--curve", COLOURS[number % COLOURS.length]);
    return label;
  }));
}
