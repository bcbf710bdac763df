// A canvas of as many pixels as the picture has, shown enlarged: what is painted is exactly what is sent.
// The surroundings give: element, props, watch. props.value is what was painted, as a data URL; props.sheet says
// what it is painted on (height, width, url of a picture) and with which colors.

const layer = document.createElement("canvas");
const ink = layer.getContext("2d", { willReadFrequently: true });
let color = null, erasing = false, size = 8, last = null;
const past = [];
// What was painted by hand: other sizes are made from it, so that nothing is lost while a size is being typed.
const original = document.createElement("canvas");

const make = (tag, attributes, ...children) => {
  const made = Object.assign(document.createElement(tag), attributes);
  made.append(...children);
  return made;
};

// No canvas path: those have soft edges, and their colors would be no colors of the sample.
const dot = (x, y) => {
  const radius = size / 2;
  for (let row = Math.ceil(y - radius); row < y + radius; row++) {
    const half = Math.sqrt(Math.max(0, radius * radius - (row + 0.5 - y) ** 2));
    const from = Math.round(x - half), length = Math.max(1, Math.round(x + half) - from);
    if (erasing) ink.clearRect(from, row, length, 1);
    else ink.fillRect(from, row, length, 1);
  }
};

const stroke = (event) => {
  const box = layer.getBoundingClientRect();
  const x = ((event.clientX - box.left) * layer.width) / box.width;
  const y = ((event.clientY - box.top) * layer.height) / box.height;
  const from = last ?? [x, y];
  const steps = Math.ceil(Math.max(Math.abs(x - from[0]), Math.abs(y - from[1]), 1));
  ink.fillStyle = color;
  for (let step = 1; step <= steps; step++) {
    dot(from[0] + ((x - from[0]) * step) / steps, from[1] + ((y - from[1]) * step) / steps);
  }
  last = [x, y];
};

const remembered = () => {
  original.width = layer.width;
  original.height = layer.height;
  original.getContext("2d").drawImage(layer, 0, 0);
};

const send = () => {
  remembered();
  props.value = layer.toDataURL("image/png");
  mount();
};

const remember = () => {
  past.push(ink.getImageData(0, 0, layer.width, layer.height));
  if (past.length > 20) past.shift();
};

layer.addEventListener("pointerdown", (event) => {
  layer.setPointerCapture(event.pointerId);
  remember();
  last = null;
  stroke(event);
});
layer.addEventListener("pointermove", (event) => {
  if (event.buttons & 1) stroke(event);
});
layer.addEventListener("pointerup", send);

const choose = (chosen) => {
  color = chosen;
  erasing = false;
  draw();
};

const swatch = (one) =>
  make("button", {
    type: "button", className: "swatch" + (one === color && !erasing ? " chosen" : ""), title: one,
    ariaLabel: `Paint with ${one}`, style: `background:${one}`, onclick: () => choose(one),
  });

const tool = (text, title, act, chosen = false) =>
  make("button", { type: "button", className: "tool" + (chosen ? " chosen" : ""), title, onclick: act }, text);

const tools = () => {
  const other = make("input", { type: "color", title: "Another color", value: color, ariaLabel: "Another color" });
  other.onchange = () => choose(other.value);
  const width = make("input", { type: "range", min: 1, max: 48, value: size, ariaLabel: "Width of the brush" });
  width.oninput = () => { size = Number(width.value); };
  return [
    make("span", { className: "swatches" }, ...props.sheet.colors.map(swatch), ...(props.sheet.others ? [other] : [])),
    make("label", { className: "width" }, "Width", width),
    make("span", { className: "tools" },
      tool("Erase", "Take paint away", () => { erasing = !erasing; draw(); }, erasing),
      tool("Undo", "Take the last stroke back", () => {
        if (past.length) { ink.putImageData(past.pop(), 0, 0); send(); }
      }),
      tool("Clear", "Take all paint away", () => {
        remember();
        ink.clearRect(0, 0, layer.width, layer.height);
        send();
      })),
  ];
};

const draw = () => {
  element.querySelector(".painter-tools").replaceChildren(...tools());
};

// Whatever the surroundings drew anew, what was painted goes back into it.
const mount = () => {
  const paper = element.querySelector(".painter-paper");
  paper.style.aspectRatio = `${layer.width} / ${layer.height}`;
  // As large as the window leaves room for, so that nothing has to be scrolled while painting.
  paper.style.maxWidth = `max(240px, calc((100vh - 350px) * ${layer.width / layer.height}))`;
  paper.replaceChildren(...(props.sheet.url ? [make("img", { src: props.sheet.url, alt: "", draggable: false })] : []), layer);
  draw();
};

const begin = () => {
  layer.width = props.sheet.width;
  layer.height = props.sheet.height;
  past.length = 0;
  mount();
};

// The same paper in another size keeps what was painted on it; no soft edges here either.
const rescale = () => {
  ink.imageSmoothingEnabled = false;
  ink.drawImage(original, 0, 0, layer.width, layer.height);
  props.value = layer.toDataURL("image/png");
};

let paper = null;
const follow = () => {
  const { colors, ...wanted } = props.sheet;
  if (!colors.includes(color)) color = colors[0] ?? "#808080";
  if (JSON.stringify(wanted) === JSON.stringify(paper)) return mount();
  const before = paper;
  paper = wanted;
  begin();
  if (before === null) return;
  if (before.url === wanted.url && props.value) rescale();
  else props.value = "";
  mount();
};

const kept = props.value;
follow();
if (kept) {
  const image = make("img", { src: kept });
  image.onload = () => {
    ink.drawImage(image, 0, 0);
    remembered();
  };
}
watch("sheet", follow);
