// Text on the page whose contrast to its background is below 4.5, or 3 for large text (WCAG 2.1, 1.4.3), and
// elements that take the focus but have no name for a screen reader (4.1.2).
() => {
  const probe = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const parse = (text) => {
    probe.clearRect(0, 0, 1, 1);
    probe.fillStyle = text;
    probe.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = probe.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = (top, below) => [0, 1, 2].map((k) => top[k] * top[3] + below[k] * (1 - top[3])).concat(1);
  const light = (colour) => {
    const [r, g, b] = colour.map((value) => value / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    const layers = [];
    for (let at = element; at; at = at.parentElement) layers.push(parse(getComputedStyle(at).backgroundColor));
    return layers.reverse().reduce((below, top) => over(top, below), [255, 255, 255, 1]);
  };
  const poor = new Set();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const element = node.parentElement;
    const style = getComputedStyle(element);
    const isOff = element.closest("[disabled], [aria-disabled], .disabled, script, style, option, .material-icons, .q-icon");
    if (!node.data.trim() || isOff || !element.checkVisibility({ checkVisibilityCSS: true })) continue;
    const ground = behind(element);
    const colour = element.namespaceURI.endsWith("svg") ? style.fill : style.color;
    const levels = [light(over(parse(colour), ground)), light(ground)].sort((a, b) => b - a);
    const ratio = (levels[0] + 0.05) / (levels[1] + 0.05);
    const size = parseFloat(style.fontSize);
    const isLarge = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    if (ratio < (isLarge ? 3 : 4.5)) {
      poor.add(`${node.data.trim().slice(0, 40)}: ${ratio.toFixed(2)} ${colour} on ${ground}`);
    }
  }
  const focusable = document.querySelectorAll("button, a, input, select, [tabindex='0']");
  for (const element of focusable) {
    const isNamed = element.ariaLabel || element.title || element.innerText?.trim() || element.labels?.length;
    const isPart = element.matches(".q-slider__track-container"); // the slider around it has the name
    if (!isNamed && !isPart && element.checkVisibility()) poor.add(`no name: ${element.outerHTML.slice(0, 120)}`);
  }
  return [...poor];
}
