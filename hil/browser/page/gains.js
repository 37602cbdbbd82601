// A slider for each gain: it sends the parameter to the board at once.

const SHOWN = [["kp", 40], ["ki", 25], ["acceleration", 30]];  // and the slider's end

/** Add the sliders to a form field, before its text; `set(name, value)` sends a value. */
export function addGains(field, protocol, set) {
  const text = field.querySelector("p"), sliders = [];
  for (const [name, most] of SHOWN) {
    const parameter = protocol.parameters.find((one) => one.name === name);
    const label = document.createElement("label");
    label.title = parameter.doc;
    label.innerHTML = `<span>${name} <small>${parameter.unit.replace("^2", "²")}</small></span>
      <input type="range" min="0" max="${most}" step="0.1"><output></output>`;
    const [, slider, output] = label.children;
    slider.value = parameter.default;
    slider.dataset.gain = name;
    const show = () => (output.textContent = Number(slider.value).toFixed(1));
    slider.addEventListener("input", () => {
      show();
      set(name, Number(slider.value));
    });
    show();
    text.before(label);
    sliders.push([slider, parameter.default]);
  }
  field.querySelector("[data-reset]").addEventListener("click", () => {
    for (const [slider, value] of sliders) {
      slider.value = value;
      slider.dispatchEvent(new Event("input"));
    }
  });
}
