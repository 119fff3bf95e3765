// SPDX-License-Identifier: BSD-3-Clause
// The lab's page: connects what the server sends to what is on the screen.
import {Camera} from "./camera.js";
import {Controls} from "./controls.js";
import {Episodes} from "./episodes.js";
import {Exercises} from "./exercises.js";
import {Hands} from "./hands.js";
import {Headset} from "./headset.js";
import {Interface} from "./interface.js";
import {Notebook} from "./notebook.js";
import {Numbers} from "./numbers.js";
import {arePoints, Overlay} from "./overlay.js";
import {element, Panel} from "./panel.js";
import {Plans} from "./plans.js";
import {Plots} from "./plots.js";
import {Recordings} from "./recordings.js";
import {Simulation} from "./simulation.js";
import {Steering} from "./steering.js";
import {LANGUAGES, load, text} from "./texts.js";
import {Topics} from "./topics.js";
import {View} from "./view.js";

// The page tells its connection this often that it is there; browsers do it once a second for a page that nobody sees.
const ALIVE_MS = 100;
const LOG_LINES = 200;
const LEVELS = {1: "debug", 2: "info", 4: "warning", 8: "error", 16: "error"};
const NOTE_MS = 15000;

const byId = (name) => document.getElementById(name);
const token = new URLSearchParams(location.search).get("token") ?? "";
const query = `?token=${encodeURIComponent(token)}`;
// The page may be served below any path, by a front door for many labs.
const sockets = new URL(".", location.href).href.replace(/^http/, "ws");

const worker = new Worker("page/worker.js");
const send = (operation) => worker.postMessage(operation);
const plans = new Plans();
const panel = new Panel(send, plans);
const state = {connected: null, number: 0, may_act: false, mine: false, free: true, robot: null, scene: null, factor: null};
let view = null;
const hands = new Hands(send, () => view, plans);
const controls = new Controls(send, query, () => state.number, note);
const recordings = new Recordings(send, query, () => state.number, note);
const episodes = new Episodes(send, query);
const plots = new Plots();
const numbers = new Numbers(() => new Topics(`${sockets}rosbridge${query}`));
const exercises = new Exercises();
const comparison = new Interface(send);
const notebook = new Notebook(send, query);
const simulation = new Simulation(send, () => view);
const steering = new Steering(send, () => view);
const headset = new Headset(steering, send, () => view);
const overlay = new Overlay(send, () => view);
const camera = new Camera(() => ({paused: simulation.paused, factor: state.factor}));
let robot = {};
let noteTimer = 0;
let noted = null;

// Say something for a while; without a code, the last words again in the language of now.
function note(code, detail) {
  if (code) {
    clearTimeout(noteTimer);
    noteTimer = setTimeout(() => { noted = null; note(); }, NOTE_MS);
    noted = {code, detail};
  }
  byId("told").textContent = noted ? text(noted.code, {text: noted.detail ?? ""}) : "";
}

// What a hint asked for has been done.
function settle(...codes) {
  if (!codes.includes(noted?.code)) return;
  noted = null;
  note();
}

function stop() {
  panel.settle();
  steering.letGo();
  send({op: "stop"});
  if (!state.connected) note("connecting");
}

// What the header says; from the whole state, so that a change of language needs nothing else.
function refresh() {
  const light = (name, kind, words) => {
    byId(name).className = `light ${kind}`;
    byId(name).textContent = words;
  };
  light("connection", state.connected ? "good" : "bad", text(state.connected ? "connected" : "connecting"));
  const kinds = {unknown: "", enabled: "good", disabled: "idle", stopped: "bad"};
  const kind = !state.robot || !state.connected ? "unknown"
    : state.robot.stopped ? "stopped" : state.robot.enabled ? "enabled" : "disabled";
  light("robot-state", kinds[kind], text(`robot_${kind}`));
  byId("factor").textContent = simulation.paused ? text("paused")
    : state.factor === null ? "" : text("factor", {value: state.factor.toFixed(2)});
  byId("enable").textContent = text(kind === "enabled" ? "disable" : "enable");
  byId("enable").disabled = !state.mine || kind === "unknown";
  byId("control").textContent = text(!state.may_act ? "watching" : state.mine ? "release" : state.free ? "take" : "take_over");
  byId("control").disabled = !state.may_act || !state.connected;
  document.body.dataset.control = state.mine ? "mine" : state.free ? "free" : "other";
  panel.allow(state.mine && state.connected);
  const [acting, driving] = [state.may_act, state.mine].map((is) => Boolean(is && state.connected));
  controls.allow(driving);
  recordings.allow(acting, driving);
  episodes.allow(acting);
  simulation.allow(driving);
  hands.allow(acting, driving);
  steering.allow(driving);
  notebook.allow(acting);
  comparison.allow(acting);
}

// The front door of a class knows why a lab does not answer: it was stopped, has ended, or is about to start.
async function sayWhyNot() {
  const answer = await fetch(`.${location.search}`, {headers: {Accept: "text/plain"}}).catch(() => null);
  if (answer?.status === 503 && !state.connected) note("not_served", (await answer.text()).trim());
}

const served = {
  connected({is}) {
    state.connected = is;
    if (is) settle("not_served");
    else {
      Object.assign(state, {mine: false, free: true, robot: null});
      sayWhyNot();
    }
    refresh();
  },
  hello({number, may_act}) {
    Object.assign(state, {number, may_act});
    if (overlay.isWatching) overlay.watch();
    refresh();
  },
  control({mine, free}) {
    if (!mine) panel.settle();
    if (mine) settle("not_in_control");
    Object.assign(state, {mine, free});
    refresh();
  },
  robot(described) {
    robot = described;
    buildPanels();
    camera.build(robot.cameras ?? []);
    sayOfView();
    refresh();
  },
  told({code, text: detail}) {
    panel.settle();
    plans.answered(null);
    // What is still held would move again as soon as it can.
    if (code !== "held") steering.letGo();
    note(code, detail);
  },
  rested() {
    panel.rested();
  },
  simulation(is) {
    simulation.show(is);
    refresh();
  },
  topics({types}) {
    numbers.list(types);
    overlay.listTopics(types);
  },
  grabbed(object) {
    simulation.grabbed(object);
  },
  recording(kept) {
    recordings.show(kept);
  },
  episodes(state) {
    episodes.show(state);
  },
  result(result) {
    exercises.show(result);
  },
  interface(state) {
    comparison.show(state);
  },
  notebook(is) {
    notebook.show(is);
  },
  reach(answer) {
    hands.answered(answer);
  },
  plan(answer) {
    plans.answered(answer);
  },
  frames({frames}) {
    overlay.showFrames(frames);
  },
  poses({data}) {
    if (arePoints(data)) {
      overlay.showPoints(data);
      return;
    }
    if (!view || view.setPoses(data)) return;
    loadScene(data);
  },
};

let loading = null;
async function loadScene(poses) {
  if (loading) return;
  loading = new DataView(poses).getUint32(0, true);
  try {
    const answer = await fetch(`scene${query}`);
    if (!answer.ok) return;
    const scene = await answer.json();
    await view.setScene(scene, async (name) => {
      const shape = await fetch(`scene/${name}${query}`);
      if (!shape.ok) throw new Error(`shape ${name}: ${shape.status}`);
      return new Float32Array(await shape.arrayBuffer());
    });
    view.setPoses(poses);
    simulation.listObjects(scene.bodies);
    steering.say();
  } catch (error) {
    // The scene has changed while it was loading; the next poses ask for it again.
    console.info("the scene is loaded again:", error.message);
  } finally {
    loading = null;
    sayOfView();
  }
}

function sayOfView() {
  const words = !view ? "no_webgl" : view.revision !== null ? "" : robot.has_scene === false ? "no_scene" : "loading";
  byId("view-note").hidden = !words;
  byId("view-note").textContent = words && text(words);
}

function buildPanels() {
  panel.build(robot);
  plans.build(robot);
  hands.build(robot.hands ?? []);
  steering.build(robot);
  controls.build(robot);
  episodes.build();
  plots.build(robot.joints ?? []);
  simulation.build(robot);
}

function startTopics() {
  const topics = new Topics(`${sockets}rosbridge${query}`);
  topics.subscribe("/robot/state", "baxter_core_msgs/AssemblyState", 100, 1, (message) => {
    const was = state.robot;
    state.robot = message;
    if (message.enabled && !was?.enabled) settle("not_ready", "stopped");
    if (was?.enabled !== message.enabled || was?.stopped !== message.stopped) refresh();
  });
  topics.subscribe("/robot/joint_states", "sensor_msgs/JointState", 60, 1, (message) => {
    const {name, position} = message;
    panel.show(Object.fromEntries(name.map((joint, number) => [joint, position[number]])));
    plots.take(message);
  });
  topics.subscribe("/gazebo/performance_metrics", "gazebo_msgs/PerformanceMetrics", 1000, 1, (message) => {
    state.factor = message.real_time_factor;
    refresh();
  });
  topics.subscribe("/rosout_agg", "rosgraph_msgs/Log", 0, LOG_LINES, ({level, name, msg}) => {
    const log = byId("log");
    const wasAtEnd = log.scrollTop + log.clientHeight >= log.scrollHeight - 8;
    log.append(element("li", {className: LEVELS[level] ?? "info"}, element("b", {textContent: name}), ` ${msg}`));
    while (log.children.length > LOG_LINES) log.firstChild.remove();
    if (wasAtEnd) log.scrollTop = log.scrollHeight;
  });
  controls.start(topics);
  steering.start(topics);
  camera.start(topics);
}

function paintView() {
  const style = getComputedStyle(document.documentElement);
  view?.paint(style.getPropertyValue("--sky").trim(), style.getPropertyValue("--lines").trim());
}

function startChoices(language) {
  byId("language").append(...Object.entries(LANGUAGES).map(([value, name]) => element("option", {value, textContent: name})));
  byId("language").value = language;
  byId("language").onchange = async () => {
    localStorage.setItem("language", byId("language").value);
    await load(byId("language").value);
    buildPanels();
    camera.build(robot.cameras ?? []);
    episodes.list();
    exercises.refresh();
    comparison.refresh();
    notebook.refresh();
    sayOfView();
    note();
    refresh();
  };
  const colour = () => {
    document.documentElement.dataset.theme = byId("theme").value;
    paintView();
  };
  byId("theme").value = localStorage.getItem("theme") ?? "";
  byId("theme").onchange = () => {
    localStorage.setItem("theme", byId("theme").value);
    colour();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paintView);
  colour();
}

function startButtons() {
  byId("stop").onclick = stop;
  byId("enable").onclick = () => send({op: state.robot?.enabled ? "disable" : "enable"});
  byId("control").onclick = () => send({op: state.mine ? "release" : "take"});
  for (const name of ["front", "side", "top"]) byId(`view-${name}`).onclick = () => view?.look(name);
  byId("show-world").onchange = ({target}) => view?.show(target.checked);
  // Everywhere, also where the browser would press a button or open a list; that is what Enter is for.
  for (const kind of ["keydown", "keyup"]) {
    addEventListener(kind, (event) => {
      if (event.code !== "Space") return;
      event.preventDefault();
      event.stopPropagation();
      if (kind === "keydown" && !event.repeat) stop();
    }, {capture: true});
  }
  // The browser would switch a checkbox with the space bar alone.
  addEventListener("keydown", ({key, repeat, target}) => {
    if (key === "Enter" && !repeat && target.type === "checkbox") target.click();
  });
}

const known = localStorage.getItem("language") ?? navigator.language.split("-")[0];
const language = known in LANGUAGES ? known : "en";
await load(language);
try {
  view = new View(byId("view"));
} catch (error) {
  console.info("no 3D view:", error.message);
}
startChoices(language);
startButtons();
sayOfView();
refresh();
worker.onmessage = ({data}) => served[data.op]?.(data);
send({address: `${sockets}lab${query}`});
const sayAlive = () => send({visible: !document.hidden});
setInterval(sayAlive, ALIVE_MS);
document.addEventListener("visibilitychange", sayAlive);
startTopics();
// For the console, and for tests.
globalThis.lab = {view, state, send, hands, controls, simulation, notebook, overlay, steering, headset, episodes, served};
