// The beginning, when all else is there.
"use strict";

const entries = [["rgb(0 158 115)", "reward above 0"], ["rgb(204 121 167)", "below 0"], ["currentColor", "the agent's path"], [MARKED, "mistakes shown"]];
for (const [color, words] of entries) {
  const entry = add($("key"), "span");
  add(entry, "i", { style: `background: ${color}` });
  entry.append(words);
}
choose({});
redraw(drawing, { remember: false });
new ResizeObserver(() => {
  show();
  edit();
  if (counted.length) drawHistogram($("histogram"), counted);
}).observe($("lab"));
new MutationObserver(() => {
  show();
  edit();
}).observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
