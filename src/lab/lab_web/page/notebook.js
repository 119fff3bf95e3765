// SPDX-License-Identifier: BSD-3-Clause
// JupyterLab beside the robot, in a frame, and the separator between the two.
import {element} from "./panel.js";
import {text} from "./texts.js";

const byId = (name) => document.getElementById(name);
// The notebook's share of the width [%], as the separator says it.
const [LEAST, MOST, STEP, DEFAULT] = [20, 80, 5, 55];
// Below this width [px], as on a telephone held either way, JupyterLab shows a notebook alone, with its list of files
// closed: it would leave too little beside it.
const NARROW = 900;
// JupyterLab takes a while until it has opened what it had open before.
const LOOK_MS = 200;

export class Notebook {
  constructor(send, query) {
    this.send = send;
    this.query = query;
    this.state = null;
    this.may = false;
    this.isOpen = localStorage.getItem("notebook") === "open";
    this.loaded = "";
    this.isList = false;
    this.timer = 0;
    this.share = Number(localStorage.getItem("notebook-share")) || DEFAULT;
    byId("notebook-toggle").onclick = () => this.toggle();
    byId("notebook-file").onchange = () => this.load(true);
    byId("notebook-frame").onload = () => this.closeList();
    this.startSplit();
    this.setShare(this.share);
  }

  // What the server says; a page without it has no notebook to offer.
  show(state) {
    this.state = state;
    const chosen = byId("notebook-file").value;
    byId("notebook-file").replaceChildren(
      element("option", {value: ""}), ...state.files.map((path) => element("option", {value: path, textContent:
        path.replace(/^.*\//, "").replace(/\.ipynb$/, "").replaceAll("_", " ")})));
    byId("notebook-file").value = chosen;
    this.refresh();
  }

  allow(may) {
    this.may = may;
    this.refresh();
  }

  toggle() {
    this.isOpen = !this.isOpen;
    localStorage.setItem("notebook", this.isOpen ? "open" : "");
    // After a failure, opening it again is another try.
    if (this.isOpen && this.state?.state === "failed") this.send({op: "notebook"});
    this.refresh();
  }

  refresh() {
    // A connection that is lost for a moment takes no notebook away.
    const offered = Boolean(this.state) && (this.may || this.loaded !== "");
    const isOpen = offered && this.isOpen;
    byId("notebook-toggle").hidden = !offered;
    byId("notebook-toggle").textContent = text(isOpen ? "notebook_hide" : "notebook_show");
    byId("notebook-toggle").setAttribute("aria-expanded", String(isOpen));
    for (const name of ["notebook", "split"]) byId(name).hidden = !isOpen;
    document.body.dataset.notebook = isOpen ? "open" : "";
    if (!isOpen) return;
    const {state, why} = this.state;
    byId("notebook-file").options[0].textContent = text("notebook_files");
    byId("notebook-said").textContent = state === "running" ? ""
      : state === "failed" ? text("notebook_failed", {text: why}) : text("notebook_starting");
    if (state === "off" && this.may) this.send({op: "notebook"});
    this.load(false);
  }

  // Each start of the server has a number; a frame of an earlier one shows nothing that works.
  load(again) {
    const {state, number} = this.state;
    if (state !== "running" || (this.loaded === number && !again)) return;
    this.loaded = number;
    this.isList = again && !byId("notebook-file").value;
    byId("notebook-frame").src = this.address(byId("notebook-file").value);
  }

  // Its symbol at the left edge opens it again; so does who chooses it by name.
  async closeList() {
    const frame = byId("notebook-frame");
    clearTimeout(this.timer);
    if (frame.clientWidth >= NARROW || this.isList) return;
    const app = frame.contentWindow?.jupyterapp;
    if (!app) {
      if (this.loaded !== "") this.timer = setTimeout(() => this.closeList(), LOOK_MS);
      return;
    }
    await app.restored;
    app.shell.collapseLeft();
    app.shell.collapseRight();
  }

  // Of a file below the topmost folder, or, for "", of the list of files.
  address(path) {
    if (!path) return `notebook/lab${this.query}`;
    const mode = byId("notebook-frame").clientWidth < NARROW ? "doc" : "lab";
    return `notebook/${mode}/tree/${path.split("/").map(encodeURIComponent).join("/")}${this.query}`;
  }

  startSplit() {
    const split = byId("split");
    split.onkeydown = (event) => {
      const steps = {ArrowLeft: -STEP, ArrowRight: STEP, Home: -100, End: 100}[event.key];
      if (!steps) return;
      event.preventDefault();
      this.setShare(this.share + steps);
    };
    // Captured, so that the frame does not take the pointer.
    split.onpointerdown = (event) => split.setPointerCapture(event.pointerId);
    split.onpointermove = (event) => {
      if (!split.hasPointerCapture(event.pointerId)) return;
      const {left, width} = document.querySelector("main").getBoundingClientRect();
      this.setShare(Math.round((event.clientX - left) / width * 100));
    };
  }

  setShare(share) {
    this.share = Math.min(MOST, Math.max(LEAST, share));
    localStorage.setItem("notebook-share", this.share);
    document.body.style.setProperty("--share", `${this.share}%`);
    byId("split").setAttribute("aria-valuenow", this.share);
  }
}
