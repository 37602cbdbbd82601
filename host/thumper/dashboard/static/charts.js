// Strip charts of both wheels: set-point and speed, PWM and its integral part. Freeze, window, CSV.

import uPlot from "./uplot_module.js";
import { colour, onTheme } from "./colours.js";
import { on } from "./stream.js";

const KEPT_S = 120;
const COLUMNS = [
  "time_s",
  ...["left", "right"].flatMap((side) => [
    `${side}_setpoint_rad_s`, `${side}_speed_rad_s`, `${side}_pwm`, `${side}_integral_pwm`, `${side}_current_A`,
  ]),
];
const PLOTS = [
  { title: "Left · rad/s", columns: [1, 2], names: ["set-point", "speed"], floor: 2 },
  { title: "Right · rad/s", columns: [6, 7], names: ["set-point", "speed"], floor: 2 },
  { title: "Left · of 255", columns: [3, 4], names: ["PWM", "integral"], floor: 40 },
  { title: "Right · of 255", columns: [8, 9], names: ["PWM", "integral"], floor: 40 },
];
const STROKES = [["setpoint", "speed"], ["setpoint", "speed"], ["pwm", "integral"], ["pwm", "integral"]];

class Charts {
  constructor(root) {
    this.rows = [];
    this.frozen = false;
    this.window_s = 30;
    this.buildBar(root);
    const grid = root.appendChild(document.createElement("div"));
    grid.className = "tp-charts";
    this.plots = PLOTS.map((plot, k) => this.build(grid, plot, STROKES[k]));
    new ResizeObserver(() => this.resize()).observe(grid);
    onTheme(() => this.plots.forEach(({ chart }) => chart.redraw(false, true)));
    on("wheels", (rows) => this.add(rows));
    on("fresh", () => { if (!this.frozen) this.rows = []; });
  }

  buildBar(root) {
    const bar = root.appendChild(document.createElement("div"));
    bar.className = "tp-chartbar";
    const title = bar.appendChild(document.createElement("h2"));
    title.textContent = "Wheels";
    const choice = bar.appendChild(document.createElement("select"));
    choice.setAttribute("aria-label", "time shown");
    for (const seconds of [10, 30, 60, 120]) {
      const option = choice.appendChild(new Option(`${seconds} s`, seconds));
      option.selected = seconds === this.window_s;
    }
    choice.addEventListener("change", () => {
      this.window_s = Number(choice.value);
      this.show();
    });
    const freeze = this.button(bar, "pause", "Freeze");
    freeze.dataset.chart = "freeze";
    freeze.addEventListener("click", () => {
      this.frozen = !this.frozen;
      freeze.classList.toggle("on", this.frozen);
      freeze.lastChild.textContent = this.frozen ? "Frozen" : "Freeze";
    });
    const csv = this.button(bar, "download", "CSV");
    csv.dataset.chart = "csv";
    csv.addEventListener("click", () => this.save());
  }

  button(bar, icon, text) {
    const button = bar.appendChild(document.createElement("button"));
    button.type = "button";
    button.innerHTML = `<i class="material-icons">${icon}</i><span>${text}</span>`;
    return button;
  }

  build(grid, { title, columns, names, floor }, strokes) {
    const box = grid.appendChild(document.createElement("div"));
    const head = box.appendChild(document.createElement("div"));
    head.className = "tp-charthead";
    head.appendChild(document.createElement("b")).textContent = title;
    const values = names.map((name, k) => {
      const key = head.appendChild(document.createElement("span"));
      key.style.setProperty("--key", `var(--tp-${strokes[k]})`);
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
        y: { range: (_, low, high) => [Math.min(low ?? 0, -floor / 4), Math.max(high ?? 0, floor)] },
      },
      axes: [{ ...axis, size: 24, values: (_, ticks) => ticks.map((t) => `${t} s`) }, { ...axis, size: 38 }],
      series: [
        {},
        ...names.map((label, k) => ({
          label,
          stroke: () => colour(strokes[k]),
          width: k === 0 ? 1.5 : 2,
          points: { show: false },
        })),
      ],
    }, [[0], ...columns.map(() => [null])], box);
    return { chart, columns, box, head, values, digits: floor > 10 ? 0 : 2 };
  }

  resize() {
    for (const { chart, box, head } of this.plots) {
      const { width, height } = box.getBoundingClientRect();
      const rest = height - head.offsetHeight;
      if (width > 0) chart.setSize({ width: Math.floor(width), height: Math.max(60, Math.floor(rest)) });
    }
  }

  add(rows) {
    if (this.frozen) return;
    const last = this.rows.at(-1)?.[0] ?? -Infinity;
    if (rows[0][0] < last) this.rows = []; // the robot's clock was set back: it was started anew
    this.rows.push(...rows);
    const newest = this.rows.at(-1)[0];
    const first = this.rows.findIndex((row) => row[0] > newest - KEPT_S);
    if (first > 0) this.rows.splice(0, first);
    this.show();
  }

  show() {
    if (this.rows.length === 0) return;
    const newest = this.rows.at(-1)[0];
    const rows = this.rows.filter((row) => row[0] >= newest - this.window_s);
    const times = rows.map((row) => row[0] - newest);
    for (const { chart, columns, values, digits } of this.plots) {
      chart.setData([times, ...columns.map((column) => rows.map((row) => row[column]))]);
      values.forEach((output, k) => { output.textContent = rows.at(-1)[columns[k]].toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1"); });
    }
  }

  save() {
    const text = [COLUMNS.join(","), ...this.rows.map((row) => row.join(","))].join("\n");
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${text}\n`], { type: "text/csv" }));
    link.download = "wheels.csv";
    link.click();
    URL.revokeObjectURL(link.href);
  }
}

export function charts(root) {
  root.charts = new Charts(root);
}
