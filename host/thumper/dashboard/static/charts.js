// Strip charts of both wheels: setpoint and speed, PWM and its integral term. Freeze, time window, CSV.

import { colour, onThemeChange } from "./colours.js";
import { fixed } from "./numbers.js";
import { on } from "./stream.js";
import uPlot from "./uplot_module.js";

const HISTORY_S = 120;
const WINDOWS_S = [10, 30, 60, 120];
const HEADROOM = 0.1; // of the range, above and below: a line at the edge would be cut
const LOW_SCREEN = "(min-width: 901px) and (max-height: 720px), (min-width: 561px) and (max-height: 499px)"; // map and charts do not both fit
const COLUMNS = [
  "time_s",
  ...["left", "right"].flatMap((side) => [
    `${side}_setpoint_rad_s`, `${side}_speed_rad_s`, `${side}_pwm`, `${side}_integral_pwm`, `${side}_current_A`,
  ]),
];
// `scale`: the columns of both sides, which have one y axis so that they can be compared
const SPEED = { names: ["set-point", "speed"], colours: ["setpoint-line", "speed"], widths: [4, 2], minTop: 2, digits: 2, scale: [1, 2, 6, 7] };
const PWM = { names: ["PWM", "integral"], colours: ["pwm", "integral"], widths: [1.5, 2], minTop: 40, digits: 0, scale: [3, 4, 8, 9] };
const PLOTS = [
  { title: "Left · rad/s", columns: [1, 2], ...SPEED },
  { title: "Right · rad/s", columns: [6, 7], ...SPEED },
  { title: "Left · PWM of 255", columns: [3, 4], ...PWM },
  { title: "Right · PWM of 255", columns: [8, 9], ...PWM },
];

// A quarter of the height: uPlot's increments are 1, 2, 2.5 and 5, so every y axis has at least two labels.
const labelSpace = (_chart, _axis, _low, _high, height) => Math.max(10, height / 4);

class Charts {
  // A chart that is not `open` is closed at first on a low screen.
  constructor(root, { open = false }) {
    this.rows = []; // each in the order of COLUMNS
    this.shown = []; // those in the time window
    this.frozen = false;
    this.window_s = WINDOWS_S[0];
    this.addToolbar(root, open);
    const grid = root.appendChild(document.createElement("div"));
    grid.className = "tp-charts";
    this.plots = PLOTS.map((plot) => this.addPlot(grid, plot));
    new ResizeObserver(() => this.resize()).observe(grid);
    onThemeChange(() => this.plots.forEach(({ chart }) => chart.redraw(false, true)));
    on("wheels", (rows) => this.append(rows));
    on("playback", (recording) => {
      this.liveRows ??= this.rows;
      this.rows = recording ? [] : this.liveRows;
      if (!recording) this.liveRows = null;
    });
    on("opened", () => { if (!this.frozen) this.rows = []; });
  }

  addToolbar(root, isOpen) {
    const bar = root.appendChild(document.createElement("div"));
    bar.className = "tp-chartbar";
    const title = bar.appendChild(document.createElement("h2"));
    const toggle = title.appendChild(document.createElement("button"));
    toggle.type = "button";
    toggle.className = "tp-chartstoggle";
    toggle.innerHTML = '<i class="material-icons">expand_more</i><span>Wheels</span>';
    const setOpen = (open) => {
      root.classList.toggle("tp-closed", !open);
      toggle.setAttribute("aria-expanded", open);
    };
    toggle.addEventListener("click", () => setOpen(root.classList.contains("tp-closed")));
    setOpen(isOpen || !window.matchMedia(LOW_SCREEN).matches);
    const windowSelect = bar.appendChild(document.createElement("select"));
    windowSelect.setAttribute("aria-label", "time window");
    for (const seconds of WINDOWS_S) {
      const option = windowSelect.appendChild(new Option(`${seconds} s`, seconds));
      option.selected = seconds === this.window_s;
    }
    windowSelect.addEventListener("change", () => {
      this.window_s = Number(windowSelect.value);
      this.render();
    });
    const freeze = this.addButton(bar, "pause", "Freeze");
    freeze.dataset.chart = "freeze";
    freeze.addEventListener("click", () => {
      this.frozen = !this.frozen;
      freeze.classList.toggle("on", this.frozen);
      freeze.lastChild.textContent = this.frozen ? "Frozen" : "Freeze";
    });
    const csv = this.addButton(bar, "download", "CSV");
    csv.dataset.chart = "csv";
    csv.addEventListener("click", () => this.downloadCsv());
  }

  addButton(bar, icon, text) {
    const button = bar.appendChild(document.createElement("button"));
    button.type = "button";
    button.innerHTML = `<i class="material-icons">${icon}</i><span>${text}</span>`;
    return button;
  }

  addPlot(grid, { title, columns, names, colours, widths, minTop, digits, scale }) {
    const box = grid.appendChild(document.createElement("div"));
    const head = box.appendChild(document.createElement("div"));
    head.className = "tp-charthead";
    head.appendChild(document.createElement("b")).textContent = title;
    const outputs = names.map((name, k) => {
      const key = head.appendChild(document.createElement("span"));
      key.style.setProperty("--key", `var(--tp-${colours[k]})`);
      key.append(`${name} `);
      return key.appendChild(document.createElement("output"));
    });
    const axis = { stroke: () => colour("muted"), font: "11px Roboto, sans-serif",
      grid: { stroke: () => colour("line"), width: 1 }, ticks: { show: false } };
    const chart = new uPlot({
      width: 300,
      height: 140,
      cursor: { y: false, points: { size: 6 } },
      legend: { show: false },
      scales: {
        x: { time: false, range: () => [-this.window_s, 0] },
        y: { range: () => this.rangeOf(scale, minTop) },
      },
      axes: [{ ...axis, size: 24, values: (_, ticks) => ticks.map((t) => `${t} s`) }, { ...axis, size: 38, space: labelSpace }],
      series: [
        {},
        ...names.map((label, k) => ({
          label,
          stroke: () => colour(colours[k]),
          width: widths[k],
          points: { show: false },
        })),
      ],
    }, [[0], ...columns.map(() => [null])], box);
    return { chart, columns, box, head, outputs, digits };
  }

  // The range of these columns in the time window, at least from a quarter below 0 to `minTop`.
  rangeOf(columns, minTop) {
    let [low, high] = [-minTop / 4, minTop];
    for (const row of this.shown) {
      for (const column of columns) {
        low = Math.min(low, row[column] ?? low);
        high = Math.max(high, row[column] ?? high);
      }
    }
    const margin = HEADROOM * (high - low);
    return [low - margin, high + margin];
  }

  resize() {
    for (const { chart, box, head } of this.plots) {
      const { width, height } = box.getBoundingClientRect();
      const chartHeight = Math.max(60, Math.floor(height - head.offsetHeight));
      if (width > 0) chart.setSize({ width: Math.floor(width), height: chartHeight });
    }
  }

  append(rows) {
    if (this.frozen) return;
    const last_s = this.rows.at(-1)?.[0] ?? -Infinity;
    if (rows[0][0] < last_s) this.rows = []; // time went back: the robot restarted
    this.rows.push(...rows);
    const newest_s = this.rows.at(-1)[0];
    const first = this.rows.findIndex((row) => row[0] > newest_s - HISTORY_S);
    if (first > 0) this.rows.splice(0, first);
    this.render();
  }

  render() {
    if (this.rows.length === 0) return;
    const newest_s = this.rows.at(-1)[0];
    const rows = this.shown = this.rows.filter((row) => row[0] >= newest_s - this.window_s);
    const times_s = rows.map((row) => row[0] - newest_s);
    for (const { chart, columns, outputs, digits } of this.plots) {
      chart.setData([times_s, ...columns.map((column) => rows.map((row) => row[column]))]);
      outputs.forEach((output, k) => {
        const value = rows.at(-1)[columns[k]];
        output.textContent = value === null ? "–" : fixed(value, digits); // no set-point in an open loop
      });
    }
  }

  downloadCsv() {
    const text = [COLUMNS.join(","), ...this.rows.map((row) => row.join(","))].join("\n");
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${text}\n`], { type: "text/csv" }));
    link.download = "wheels.csv";
    link.click();
    URL.revokeObjectURL(link.href);
  }
}

export function charts(root, options) {
  root.charts = new Charts(root, options);
}
