// The robot's library: save, load and download maps, download recordings.

import { notify } from "./commands.js";
import { playRecording } from "./playback.js";
import { on, send } from "./stream.js";

const AGES = [[86400, "d"], [3600, "h"], [60, "min"], [1, "s"]];

function formatAge(saved_s) {
  const age_s = Math.max(0, Date.now() / 1000 - saved_s);
  const [seconds, unit] = AGES.find(([step]) => age_s >= step) ?? AGES.at(-1);
  return `${Math.floor(age_s / seconds)} ${unit} ago`;
}

export function library(root) {
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
    if (events.some(({ text }) => /^map saved|^recorded/.test(text))) refresh();
  });

  function addButton(row, text, label, action) {
    const button = row.appendChild(document.createElement("button"));
    button.type = "button";
    button.className = "tp-plain";
    button.textContent = text;
    button.setAttribute("aria-label", label);
    button.addEventListener("click", action);
  }

  function addRow(list, { name, MB, saved_s }, href, isMap) {
    const row = list.appendChild(document.createElement("li"));
    const title = row.appendChild(document.createElement("label"));
    title.append(name);
    title.appendChild(document.createElement("small")).textContent = `${MB} MB, ${formatAge(saved_s)}`;
    if (isMap) addButton(row, "Load", `Load the map ${name}`, () => send({ kind: "load_map", name }));
    else addButton(row, "Play", `Play ${name}`, () => playRecording(name));
    const link = row.appendChild(document.createElement("a"));
    link.href = href;
    link.download = "";
    link.className = "tp-plain tp-link";
    link.textContent = "Download";
    link.setAttribute("aria-label", `Download ${name}`);
    link.addEventListener("click", async (event) => { // say why, if there is no such file here
      event.preventDefault();
      const found = await fetch(href, { method: "GET", headers: { Range: "bytes=0-0" } });
      if (found.ok) location.assign(href);
      else notify((await found.json()).detail, "bad");
    });
  }

  async function refresh() {
    let content = { maps: [], recordings: [] };
    try {
      const answer = await fetch("/library");
      if (answer.ok) content = await answer.json();
    } catch { /* no connection: the banner says so */ }
    for (const [which, path, hint] of [
      ["maps", ({ name }) => `/library/maps/${encodeURIComponent(name)}.zip`, "None yet."],
      ["recordings", ({ name }) => `/library/recordings/${encodeURIComponent(name)}`, "None yet: press REC."],
    ]) {
      const list = root.querySelector(`[data-list=${which}]`);
      list.replaceChildren();
      content[which].forEach((item) => addRow(list, item, path(item), which === "maps"));
      if (!list.children.length) list.appendChild(document.createElement("li")).textContent = hint;
    }
  }
  refresh();
}
