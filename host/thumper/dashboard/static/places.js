// Lists of the map's places, zones and AprilTags: drive to a place, patrol, remove.

import { features } from "./annotations.js";
import { askInRow } from "./question.js";
import { keyHint } from "./shortcuts.js";
import { on, send } from "./stream.js";

const ROUNDS = [1, 2, 5, 10, 100];
const KINDS = { keepout: "keep-out", slow: "slow" };

export function places(root) {
  root.innerHTML = `
    <h2>Places</h2>
    <ul class="tp-list" data-list="places"></ul>
    <div class="tp-buttons" data-patrol hidden>
      <button type="button" class="tp-plain">Patrol</button>
      <label class="tp-check">rounds <select aria-label="rounds">${ROUNDS.map((count) => `<option>${count}</option>`).join("")}</select></label>
    </div>
    <h2>Zones</h2>
    <ul class="tp-list" data-list="zones"></ul>
    <div data-tags hidden>
      <h2>AprilTags</h2>
      <ul class="tp-list" data-list="tags"></ul>
    </div>
    <p class="tp-hint">Zones and places belong to the map: Save map keeps them. Zones do not bind manual driving.</p>`;
  const patrolBar = root.querySelector("[data-patrol]");
  const skipped = new Set(); // places without a tick: a patrol leaves them out

  const patrolNames = () => features().map(({ properties }) => properties)
    .filter(({ kind, name }) => kind === "place" && !skipped.has(name)).map(({ name }) => name);
  patrolBar.querySelector("button").addEventListener("click", () => {
    send({ kind: "patrol", places: patrolNames(), rounds: Number(patrolBar.querySelector("select").value) });
  });

  function addButton(row, text, label, action) {
    const button = row.appendChild(document.createElement("button"));
    button.type = "button";
    button.className = "tp-plain";
    button.textContent = text;
    button.setAttribute("aria-label", label);
    button.addEventListener("click", action);
  }

  function addRow(list, properties) {
    showItem(list.appendChild(document.createElement("li")), properties);
  }

  function showItem(row, properties) {
    const { kind, name, speed_percent } = properties;
    row.replaceChildren();
    const title = row.appendChild(document.createElement("label"));
    if (kind === "place") {
      const tick = title.appendChild(document.createElement("input"));
      tick.type = "checkbox";
      tick.title = "part of the patrol";
      tick.checked = !skipped.has(name);
      tick.addEventListener("change", () => {
        skipped[tick.checked ? "delete" : "add"](name);
        updatePatrol();
      });
      title.append(name);
      addButton(row, "Go", `Drive to ${name}`, () => send({ kind: "place_goal", name }));
    } else if (kind === "tag") {
      title.append(name);
    } else {
      title.append(name);
      const note = title.appendChild(document.createElement("small"));
      note.textContent = speed_percent ? `${KINDS[kind]}, ${speed_percent} %` : KINDS[kind];
    }
    const act = () => send({ kind: "remove_annotation", name });
    const back = () => showItem(row, properties);
    const question = { question: `Remove ${name} for good?`, verb: "Remove", name, act, back };
    addButton(row, "Remove", `Remove ${name}`, () => askInRow(row, question));
  }

  function updatePatrol() {
    patrolBar.hidden = features().filter(({ properties }) => properties.kind === "place").length < 2;
    patrolBar.querySelector("button").disabled = patrolNames().length === 0;
  }

  function show() {
    const all = features().map(({ properties }) => properties);
    for (const [which, isShown, hint] of [
      ["places", ({ kind }) => kind === "place", `None yet: choose the place tool${keyHint("L")}, click the map, type a name.`],
      ["zones", ({ kind }) => kind in KINDS, `None yet: choose the zone tool${keyHint("Z")} and click the corners.`],
      ["tags", ({ kind }) => kind === "tag", "None."],
    ]) {
      const list = root.querySelector(`[data-list=${which}]`);
      list.replaceChildren();
      all.filter(isShown).forEach((item) => addRow(list, item));
      if (!list.children.length) list.appendChild(document.createElement("li")).textContent = hint;
    }
    root.querySelector("[data-tags]").hidden = !all.some(({ kind }) => kind === "tag");
    updatePatrol();
  }
  on("annotations", show);
  on("snapshot", show);
  show();
}
