// The robot's library: save and load maps, play recordings; download, rename and delete both.

import { notify } from "./commands.js";
import { editMap } from "./map_editor.js";
import { playRecording } from "./playback.js";
import { askInRow } from "./question.js";
import { on, send, state } from "./stream.js";

const AGES = [[86400, "d"], [3600, "h"], [60, "min"], [1, "s"]];

function formatAge(saved_s) {
  const age_s = Math.max(0, Date.now() / 1000 - saved_s);
  const [seconds, unit] = AGES.find(([step]) => age_s >= step) ?? AGES.at(-1);
  return `${Math.floor(age_s / seconds)} ${unit} ago`;
}

const maps = () => Boolean(state.values.status?.localization?.endsWith("mapping"));

export function library(root) {
  let inUse = ""; // the map in which the robot localizes
  root.innerHTML = `
    <h2>Saved maps</h2>
    <form class="tp-buttons"><input type="text" maxlength="40" autocomplete="off" aria-label="name of the map" placeholder="name of this map">
      <button class="tp-plain">Save as</button></form>
    <ul class="tp-list" data-list="maps"></ul>
    <h2>Recordings</h2>
    <ul class="tp-list" data-list="recordings"></ul>
    <div class="tp-buttons"><button type="button" class="tp-plain" data-refresh>Refresh</button></div>`;
  const nameField = root.querySelector("input");

  root.querySelector("form").addEventListener("submit", (event) => {
    event.preventDefault();
    if (nameField.value.trim() && send({ kind: "save_as", name: nameField.value.trim() })) nameField.value = "";
  });
  root.querySelector("[data-refresh]").addEventListener("click", refresh);
  on("events", (events) => { // a map was written, a recording has ended
    if (events.some(({ text }) => /^map saved|^recorded|^renamed|^deleted|^loaded map/.test(text))) refresh();
  });

  let isRecording = Boolean(state.values.status?.recording);
  let isMapping = maps();
  on("packet", () => { // of the robot: during a playback `status` is the recording's
    const recording = Boolean(state.values.status?.recording);
    if (recording === isRecording && maps() === isMapping) return;
    isRecording = recording;
    isMapping = maps();
    refresh();
  });

  function addButton(row, text, label, action, icon = "") {
    const button = row.appendChild(document.createElement("button"));
    button.type = "button";
    button.className = icon ? "tp-icon" : "tp-plain";
    if (icon) button.innerHTML = `<i class="material-icons">${icon}</i>`;
    else button.textContent = text;
    button.title = icon ? text : "";
    button.setAttribute("aria-label", label);
    button.addEventListener("click", action);
  }

  function addRow(list, item, href, isMap) {
    showItem(list.appendChild(document.createElement("li")), item, href, isMap);
  }

  function showItem(row, item, href, isMap) {
    const { name, MB, saved_s } = item;
    const back = () => showItem(row, item, href, isMap);
    row.replaceChildren();
    const title = row.appendChild(document.createElement("label"));
    title.append(name);
    title.appendChild(document.createElement("small")).textContent = `${MB} MB, `;
    const age = title.lastChild.appendChild(document.createElement("span"));
    age.dataset.savedS = saved_s;
    age.textContent = formatAge(saved_s);
    if (isMap && inUse === name) {
      title.appendChild(document.createElement("b")).textContent = "in use";
      addButton(row, "Resume mapping", `Resume mapping in the map ${name}`, () => send({ kind: "command", name: "map_on" }));
    } else if (isMap) addButton(row, "Load", `Load the map ${name}`, () => send({ kind: "load_map", name }));
    else addButton(row, "Play", `Play ${name}`, () => playRecording(name));
    addButton(row, "Download", `Download ${name}`, () => download(href), "download");
    if (isMap) addButton(row, "Edit", `Edit the map ${name}`, () => editMap(name, refresh), "crop_rotate");
    addButton(row, "Rename", `Rename ${name}`, () => askName(row, name, isMap, back), "drive_file_rename_outline");
    addButton(row, "Delete", `Delete ${name}`, () => askDelete(row, name, back), "delete");
  }

  async function download(href) {
    const found = await fetch(href, { method: "GET", headers: { Range: "bytes=0-0" } });
    if (found.ok) location.assign(href);
    else notify((await found.json()).detail, "bad"); // say why, if there is no such file here
  }

  function askName(row, name, isMap, back) {
    const ending = isMap ? "" : ".mcap";
    row.replaceChildren();
    const form = row.appendChild(document.createElement("form"));
    form.className = "tp-buttons";
    const field = form.appendChild(document.createElement("input"));
    field.type = "text";
    field.maxLength = 40;
    field.autocomplete = "off";
    field.value = name.slice(0, name.length - ending.length);
    field.setAttribute("aria-label", `new name of ${name}`);
    form.appendChild(document.createElement("button")).textContent = "Rename";
    form.lastChild.className = "tp-go";
    addButton(form, "Keep", `Keep the name ${name}`, back);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const new_name = field.value.trim() + ending;
      if (new_name !== name && new_name !== ending) send({ kind: "rename", name, new_name });
      back();
    });
    field.select();
  }

  function askDelete(row, name, back) {
    if (state.playback === name) {
      notify(`${name} is being played: end the playback first`, "bad");
      return;
    }
    const act = () => send({ kind: "delete", name });
    askInRow(row, { question: `Delete ${name} for good?`, verb: "Delete", name, act, back });
  }

  function addHint(list, text) {
    list.appendChild(document.createElement("li")).textContent = text;
  }

  async function refresh() {
    let content = { maps: [], recordings: [] };
    try {
      const answer = await fetch("/library");
      if (answer.ok) content = await answer.json();
      inUse = content.in_use ?? "";
    } catch { /* no connection: the banner says so */ }
    for (const [which, path, hint] of [
      ["maps", ({ name }) => `/library/maps/${encodeURIComponent(name)}.zip`, "None yet."],
      ["recordings", ({ name }) => `/library/recordings/${encodeURIComponent(name)}`, "None yet: press REC."],
    ]) {
      const list = root.querySelector(`[data-list=${which}]`);
      list.replaceChildren();
      content[which].forEach((item) => addRow(list, item, path(item), which === "maps"));
      if (which === "recordings" && isRecording) addHint(list, "REC is running. The recording appears here when it ends.");
      if (!list.children.length) addHint(list, hint);
    }
  }
  setInterval(() => root.querySelectorAll("[data-saved-s]").forEach((age) => {
    age.textContent = formatAge(age.dataset.savedS);
  }), 1000);
  refresh();
}
