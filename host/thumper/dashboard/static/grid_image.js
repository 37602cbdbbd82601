// A grid in colours. It is drawn whole once, then patch by patch: the work grows with what has changed.

import { colour } from "./colours.js";

function interpolate(a, b, share) {
  return a.map((value, k) => Math.round(value + share * (b[k] - value)));
}

function rgb(name) {
  const hex = colour(name).replace("#", "");
  return [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16));
}

// A palette is a table of 256 RGBA colours, indexed by the PNG's pixel: 0 unknown, else occupancy (0...100) + 1.
function mapPalette() {
  const table = new Uint8ClampedArray(256 * 4);
  const free = rgb("map-free");
  const wall = rgb("map-wall");
  for (let value = 1; value <= 101; value += 1) {
    table.set([...interpolate(free, wall, (value - 1) / 100), 255], 4 * value);
  }
  return table;
}

function costPalette() {
  const table = new Uint8ClampedArray(256 * 4);
  const low = rgb("cost-low");
  const high = rgb("cost-high");
  for (let value = 2; value <= 101; value += 1) {
    const share = (value - 1) / 100;
    table.set([...interpolate(low, high, share), Math.round(15 + 110 * share ** 2)], 4 * value);
  }
  return table;
}

const FADE_CELLS = 12; // a costmap ends in the middle of a room: its colours fade there

// The share of a cell's opacity by its distance from the edge of the grid.
function fade(row, column, { rows, columns }) {
  const distance = Math.min(row, column, rows - 1 - row, columns - 1 - column) + 1;
  return Math.min(1, distance / FADE_CELLS);
}

const PALETTES = { map: mapPalette, local_costmap: costPalette };

function newCanvas(width, height) {
  return Object.assign(document.createElement("canvas"), { width, height });
}

// Decode a PNG of bytes; return its pixels, RGBA.
async function decode(png) {
  const bitmap = await createImageBitmap(new Blob([png], { type: "image/png" }), {
    colorSpaceConversion: "none", // the pixels are data, not colours
  });
  const context = newCanvas(bitmap.width, bitmap.height).getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
}

export class GridImage {
  // `name` chooses the palette.
  constructor(name) {
    this.palette = PALETTES[name];
    this.fades = name === "local_costmap";
    this.info = null; // position and size, once drawn
    this.drawn = Promise.resolve(); // once all that was added is drawn
  }

  // Draw the whole grid, or the patch that `info` names. Row 0 of the PNG is the lowest one of the grid.
  add({ info, image: png }) {
    this.drawn = this.drawn.then(async () => { // one after another: a later patch may cover an earlier one
      const pixels = await decode(png);
      const [row, column, rows, columns] = info.patch ?? [0, 0, info.rows, info.columns];
      if (!info.patch) this.clear(info);
      for (let k = 0; k < rows; k += 1) {
        for (let i = 0; i < columns; i += 1) {
          this.cells[(row + k) * info.columns + column + i] = pixels[4 * (k * columns + i)];
        }
      }
      this.paint(row, column, rows, columns);
    });
  }

  clear(info) {
    this.info = info;
    this.bounds = { left: info.columns, right: 0, bottom: info.rows, top: 0 }; // of the known cells
    this.cells = new Uint8Array(info.rows * info.columns); // 0 unknown, else occupancy + 1; row 0 is the lowest
    this.canvas = newCanvas(info.columns, info.rows);
  }

  paint(row, column, rows, columns) {
    if (!rows || !columns) return;
    const { info, bounds } = this;
    const palette = new Uint32Array(this.palette().buffer);
    const image = new ImageData(columns, rows);
    const colours = new Uint32Array(image.data.buffer);
    for (let k = 0; k < rows; k += 1) {
      const from = (row + k) * info.columns + column;
      const to = (rows - 1 - k) * columns; // an image's rows run top to bottom
      for (let i = 0; i < columns; i += 1) {
        const cell = this.cells[from + i];
        colours[to + i] = palette[cell];
        if (!cell) continue;
        bounds.left = Math.min(bounds.left, column + i);
        bounds.right = Math.max(bounds.right, column + i + 1);
        bounds.bottom = Math.min(bounds.bottom, row + k);
        bounds.top = Math.max(bounds.top, row + k + 1);
      }
    }
    if (this.fades) {
      for (let k = 0; k < rows; k += 1) {
        for (let i = 0; i < columns; i += 1) {
          image.data[4 * ((rows - 1 - k) * columns + i) + 3] *= fade(row + k, column + i, info);
        }
      }
    }
    this.canvas.getContext("2d").putImageData(image, column, info.rows - row - rows);
  }

  // Colour all cells again after a change of theme.
  recolour() {
    this.drawn = this.drawn.then(() => this.paint(0, 0, this.info.rows, this.info.columns));
  }
}
