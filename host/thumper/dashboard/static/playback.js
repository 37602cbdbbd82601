// Plays a recording of the library on the page: bar with play, pause, time and speed below the map.

import { notify, onCancel } from "./commands.js";
import { decode, on, playPacket, showRobot, startPlayback, state } from "./stream.js";

const PART_S = 5; // asked for at once
const AHEAD_S = 3; // ask for the next part when less is left
const TICK_MS = 50;
const SETTLE_MS = 200; // a slider that moves on asks for nothing
const SPEEDS = [1, 2, 4, 8];

class Player {
  constructor() {
    this.bar = document.createElement("div");
    this.bar.className = "tp-notlive tp-playback";
    this.bar.hidden = true;
    this.bar.setAttribute("role", "group");
    this.bar.setAttribute("aria-label", "playback");
    this.bar.innerHTML = `
      <button type="button" class="tp-plain" data-play></button>
      <input type="range" min="0" step="0.1" value="0" aria-label="time">
      <output></output>
      <select aria-label="speed">${SPEEDS.map((speed) => `<option value="${speed}">${speed} ×</option>`).join("")}</select>
      <button type="button" class="tp-plain" data-end>Back to live</button>`;
    document.querySelector(".tp-state").before(this.bar);
    [this.playButton, this.slider, this.clock, this.speed, this.endButton] = this.bar.children;
    this.playButton.addEventListener("click", () => this.setPlaying(!this.playing));
    this.slider.addEventListener("input", () => {
      clearTimeout(this.jump);
      this.jump = setTimeout(() => this.seek(Number(this.slider.value)), SETTLE_MS);
    });
    this.endButton.addEventListener("click", showRobot);
    on("playback", (name) => { if (name !== this.name) this.end(); });
    onCancel(() => {
      const isActive = Boolean(state.playback);
      showRobot();
      return isActive;
    });
  }

  async open(name) {
    this.end();
    this.name = name;
    this.time_s = 0;
    this.duration_s = 0;
    this.setPlaying(true);
    document.querySelector(".tp-mapbox").scrollIntoView(); // on a phone the list is below it
    if (await this.seek(0) && !this.timer) this.timer = setInterval(() => this.tick(), TICK_MS);
  }

  end() {
    clearInterval(this.timer);
    clearTimeout(this.jump);
    this.jump = null;
    this.timer = null;
    this.request?.abort();
    this.bar.hidden = true;
  }

  setPlaying(playing) {
    this.playing = playing;
    if (playing && this.duration_s && this.time_s >= this.duration_s) this.seek(0);
    this.playButton.textContent = playing ? "Pause" : "Play";
  }

  // Show the recording at a time; return whether that worked.
  async seek(time_s) {
    this.jump = null;
    this.time_s = time_s;
    this.packets = [];
    this.request?.abort();
    const packets = await this.load(time_s);
    if (!packets) return false;
    startPlayback(this.name, `Playback of ${this.name}: map and charts do not show the robot`);
    this.duration_s = packets[0].header.duration_s;
    this.slider.max = this.duration_s;
    this.bar.hidden = false;
    this.take(packets);
    this.show();
    return true;
  }

  // Fetch a part; null if another request replaced this one, or on an error, which is shown.
  async load(start_s) {
    const request = this.request = new AbortController();
    const address = `/library/recordings/${encodeURIComponent(this.name)}/packets?start_s=${start_s}&seconds=${PART_S}`;
    try {
      const answer = await fetch(address, { signal: request.signal });
      if (!answer.ok) throw new Error((await answer.json()).detail);
      return split(await answer.arrayBuffer());
    } catch (error) {
      if (!request.signal.aborted) {
        notify(error.message, "bad");
        this.setPlaying(false);
      }
      return null;
    } finally {
      if (this.request === request) this.request = null;
    }
  }

  take(packets) {
    this.packets.push(...packets);
    this.loaded_s = packets.at(-1).header.playback_s;
  }

  async tick() {
    if (this.jump || !this.packets) return;
    if (this.playing) {
      const time_s = this.time_s + (TICK_MS / 1000) * Number(this.speed.value);
      this.time_s = Math.min(time_s, this.loaded_s); // it waits for what is not there yet
    }
    this.show();
    if (this.time_s >= this.duration_s) this.setPlaying(false);
    const left_s = (this.loaded_s - this.time_s) / Number(this.speed.value);
    if (left_s > AHEAD_S || this.loaded_s >= this.duration_s || this.request) return;
    const packets = await this.load(this.loaded_s);
    if (packets) this.take(packets.slice(1)); // its first one repeats the state
  }

  show() {
    while (this.packets.length && this.packets[0].header.playback_s <= this.time_s + 1e-6) playPacket(this.packets.shift());
    this.slider.value = this.time_s;
    const text = `${formatTime(this.time_s)} / ${formatTime(this.duration_s)}`;
    this.clock.textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
  }
}

// An answer holds packets, each after its length (uint32, little-endian).
function split(buffer) {
  const view = new DataView(buffer);
  const packets = [];
  for (let at = 0; at < buffer.byteLength;) {
    const length = view.getUint32(at, true);
    packets.push(decode(buffer.slice(at + 4, at + 4 + length)));
    at += 4 + length;
  }
  return packets;
}

function formatTime(seconds) {
  return `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(1).padStart(4, "0")}`;
}

let player = null;

export function addPlayback() {
  player = new Player();
}

export const playRecording = (name) => player.open(name);
