// Colours of page.css for what is drawn on a canvas. SPDX-License-Identifier: Apache-2.0

// The colour that the variable has at present: the browser resolves light-dark() for elements alone.
export function colour_now(variable) {
  const probe = document.createElement('i');
  probe.style.color = `var(${variable})`;
  document.body.append(probe);
  const { color } = getComputedStyle(probe);
  probe.remove();
  return color;
}
