// uPlot ships its minified build only as a classic script that sets `window.uPlot`.
// Load that script and export uPlot, so that our modules can import it.

const script = document.createElement("script");
script.src = new URL("./uplot/uPlot.iife.min.js", import.meta.url).href;
await new Promise((resolve, reject) => {
  script.onload = resolve;
  script.onerror = () => reject(new Error(`cannot load ${script.src}`));
  document.head.append(script);
});

export default window.uPlot;
