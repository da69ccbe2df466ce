// Before Plotly: it writes styles in ways that the Content-Security-Policy forbids, and that the browser would report.
"use strict";

// An attribute "style" that a script sets is forbidden, the same through the element's own style is not.
const setAttribute = Element.prototype.setAttribute;
Element.prototype.setAttribute = function (name, value) {
  if (name === "style" && this.style) this.style.cssText = value;
  else setAttribute.call(this, name, value);
};

// The style of the maps that Plotly can draw; there are none here.
const appendChild = HTMLHeadElement.prototype.appendChild;
HTMLHeadElement.prototype.appendChild = function (child) {
  return child instanceof HTMLStyleElement ? child : appendChild.call(this, child);
};
