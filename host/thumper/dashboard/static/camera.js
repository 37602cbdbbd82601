// The newest frame of the robot's camera.

import { on } from "./stream.js";

export function camera(root) {
  const image = root.appendChild(document.createElement("img"));
  image.alt = "newest frame of the robot's camera";
  on("camera", ({ image: jpeg }) => {
    const url = URL.createObjectURL(new Blob([jpeg], { type: "image/jpeg" }));
    const previous = image.src;
    image.src = url;
    if (previous) URL.revokeObjectURL(previous);
  });
}
