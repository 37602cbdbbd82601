// The editor of saved maps: boxes dragged on the map crop or fill it, buttons rotate it. The server computes
// each result from the saved map; saving makes a new map.

import { notify, onCancel } from "./commands.js";
import { decode, on, playPacket, showRobot, startPlayback } from "./stream.js";

const BOXES = { unknown: "Erase (unknown)", free: "Free", wall: "Wall", crop: "Crop to box" };

class MapEditor {
  constructor() {
    this.name = "";
    this.drafts = new Map(); // name of a map -> its edits, until they are saved or dropped
    this.bar = document.createElement("form");
    this.bar.className = "tp-notlive tp-editor";
    this.bar.hidden = true;
    this.bar.setAttribute("aria-label", "map editor");
    this.bar.innerHTML = `
      <label>Drag a box <select aria-label="what a box does">${Object.entries(BOXES).map(([kind, text]) => `<option value="${kind}">${text}</option>`).join("")}</select></label>
      <label>Rotate <input type="number" value="90" min="-360" max="360" step="any" aria-label="angle in degrees, counter-clockwise">°</label>
      <button type="button" class="tp-plain" data-rotate>Rotate</button>
      <button type="button" class="tp-plain" data-undo>Undo</button>
      <input type="text" maxlength="40" autocomplete="off" placeholder="new name" aria-label="name of the edited map">
      <button class="tp-plain">Save as</button>
      <button type="button" class="tp-plain" data-end>Close</button>`;
    document.querySelector(".tp-state").before(this.bar);
    [this.kind, this.angle, this.newName] = this.bar.querySelectorAll("select, input");
    const click = (name, action) => this.bar.querySelector(`[data-${name}]`).addEventListener("click", action);
    for (const event of ["focus", "change"]) this.kind.addEventListener(event, () => this.startBox()); // after panning
    click("rotate", () => this.add({ edit: "rotate", angle_deg: Number(this.angle.value) }));
    click("undo", () => this.change(this.edits.slice(0, -1)));
    click("end", () => this.close());
    this.bar.addEventListener("submit", (event) => {
      event.preventDefault();
      this.save();
    });
    on("playback", () => { if (!this.opening) this.hide(); }); // a command, or a recording, shows something else
    onCancel(() => {
      const isActive = Boolean(this.name);
      if (isActive) showRobot(); // the edits stay: Edit shows them again
      return isActive;
    });
  }

  get edits() {
    return this.drafts.get(this.name) ?? [];
  }

  async open(name, onSaved) {
    this.onSaved = onSaved;
    const packet = await this.request(name, { edits: this.drafts.get(name) ?? [] });
    if (!packet) return;
    this.opening = true;
    startPlayback(name, `Editing the map ${name}: the dashboard does not show the robot`);
    this.opening = false;
    this.name = name;
    this.bar.hidden = false;
    playPacket(packet);
    const box = document.querySelector(".tp-mapbox");
    box.scrollIntoView();
    this.view = box.querySelector(".tp-map").mapView;
    this.startBox();
    this.view.canvas.focus();
  }

  startBox() {
    this.view.tools.startBox((corners_m) => this.add({ edit: this.kind.value, corners_m }));
  }

  hide() {
    this.name = "";
    this.bar.hidden = true;
  }

  close() {
    this.drafts.delete(this.name);
    showRobot();
  }

  add(edit) {
    return this.change([...this.edits, edit]);
  }

  async change(edits) {
    const { name } = this;
    const packet = await this.request(name, { edits });
    if (!packet || this.name !== name) return;
    this.drafts.set(name, edits);
    playPacket(packet);
    this.view.fit();
  }

  async save() {
    const save_as = this.newName.value.trim();
    if (!save_as) {
      this.newName.focus();
      return;
    }
    if (!await this.request(this.name, { edits: this.edits, save_as })) return;
    notify(`saved the map ${save_as}`, "good");
    this.newName.value = "";
    this.onSaved();
    this.close();
  }

  // Ask the server for the map after the edits; null on an error, which is shown.
  async request(name, content) {
    try {
      const answer = await fetch(`/library/maps/${encodeURIComponent(name)}/edit`, {
        method: "POST", body: JSON.stringify(content),
      });
      if (!answer.ok) throw new Error((await answer.json()).detail);
      return decode(await answer.arrayBuffer());
    } catch (error) {
      notify(error.message, "bad");
      return null;
    }
  }
}

let editor = null;

export function addMapEditor() {
  editor = new MapEditor();
}

export const editMap = (name, onSaved) => editor.open(name, onSaved);
