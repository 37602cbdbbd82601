// A quadrature encoder: the travel of a wheel in, the time and the levels of its edges out.

export class Encoder {
  constructor(counts_per_rev) {
    this.counts_per_rad = counts_per_rev / (2 * Math.PI);
    this.count = 0;
    this.cut = false;  // wire A; its input is then pulled high
  }

  /** Levels of the channels; A leads B while the count rises. */
  get a() {
    return this.cut || (this.count & 3) === 1 || (this.count & 3) === 2;
  }

  get b() {
    return (this.count & 3) >= 2;
  }

  /** Return the cycles of the edges of a constant rotation between two angles, each with its step, +1 or -1. */
  edges(from_rad, to_rad, start, cycles) {
    const from = from_rad * this.counts_per_rad;
    const slope = (to_rad * this.counts_per_rad - from) / cycles;
    const found = [];
    if (slope === 0) return found;
    const step = Math.sign(slope);
    for (let count = this.count; ; count += step) {
      const wait = Math.ceil((count + 0.5 * step - from) / slope);
      if (wait > cycles) return found;
      found.push([start + Math.max(wait, 0), step]);
    }
  }
}
