// A line chart over the last seconds of telemetry.
import { fit } from "./canvas.js";
import { colours } from "./colours.js";

const SPAN = 100;  // telemetry messages: 10 s
const LEFT = 34, BOTTOM = 4, TOP = 4;

export class Chart {
  /**
   * `series`: [{colour, value(telemetry), wide}]; `least`: the smallest half range of the axis;
   * `scale`: the series that the axis has room for, so that charts with the same one can be compared.
   */
  constructor(canvas, { series, least, scale = series }) {
    this.canvas = canvas;
    this.series = series;
    this.scale = scale;
    this.least = least;
  }

  draw(history) {
    const { context, width, height } = fit(this.canvas);
    const paint = colours(this.canvas);
    const shown = history.slice(-SPAN);
    const most = Math.max(this.least, ...shown.flatMap((each) => this.scale.map(({ value }) => Math.abs(value(each)))));
    const x = (i) => LEFT + ((i + SPAN - shown.length) / (SPAN - 1)) * (width - LEFT - 2);
    const y = (value) => TOP + ((most - value) / (2 * most)) * (height - TOP - BOTTOM);
    context.clearRect(0, 0, width, height);
    shadeFaults(context, shown, x, height, paint);
    axis(context, [most, 0, -most], y, width, paint);
    for (const { colour, value, wide } of this.series) {
      context.beginPath();
      shown.forEach((each, i) => context.lineTo(x(i), y(value(each))));
      context.strokeStyle = paint[colour];
      context.lineWidth = wide ? 4 : 1.8;
      context.lineJoin = "round";
      context.stroke();
    }
  }
}

function shadeFaults(context, shown, x, height, paint) {
  context.fillStyle = paint.fault;
  context.globalAlpha = 0.12;
  context.beginPath();
  shown.forEach(({ fault }, i) => {
    if (fault !== "NONE") context.rect(x(i - 0.5), 0, x(1) - x(0) + 0.5, height);
  });
  context.fill();
  context.globalAlpha = 1;
}

function axis(context, ticks, y, width, paint) {
  context.fillStyle = paint.muted;
  context.strokeStyle = paint.line;
  context.lineWidth = 1;
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const tick of ticks) {
    const at = Math.round(y(tick)) + 0.5;
    context.beginPath();
    context.moveTo(LEFT, at);
    context.lineTo(width, at);
    context.stroke();
    context.fillText(tick.toFixed(0), LEFT - 5, Math.min(Math.max(at, 7), y(-ticks[0]) - 3));
  }
}
