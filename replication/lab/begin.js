// The beginning, when all else is there.
"use strict";

for (const [id, entries] of [
  ["key", { "reward above 0": `rgb(${SEEK.join(" ")})`, "below 0": `rgb(${AVOID.join(" ")})`, "the agent's path": "currentColor", "mistakes shown": MARKED }],
  ["outcomes", { ...OUTCOMES, "hollow: trials at the cap": "transparent; border: 1px solid" }],
])
  for (const [words, color] of Object.entries(entries)) {
    const entry = add($(id), "span");
    add(entry, "i", { style: `background: ${color}` });
    entry.append(words);
  }
$("waiting").remove();
$("lab").hidden = false;
choose({});
redraw(drawing, { remember: false });
const drawAll = () => {
  show();
  edit();
  if (counted.length) drawHistogram($("histogram"), counted);
  if (effects.length) showSpecification();
};
new ResizeObserver(drawAll).observe($("lab"));
new MutationObserver(drawAll).observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
