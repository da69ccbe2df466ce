// Puts plots that zoom in place of the drawn figures. Without this script the drawn figures stay.
"use strict";

const BLUE = "#0067a0", VERMILION = "#d55e00", GREY = "#5f6368";
const LOW = 0.2, SHORT = 10;  // Of `emaphm.plotting.prognosis`: share of the largest RUL; RUL [h].
const SMALL = 700;  // Width of a window [px] below which panels stand one below the other.

function band(times, low, high, opacity, axes, name, shown) {
  const line = { mode: "lines", line: { width: 0 }, hoverinfo: "skip", showlegend: false, ...axes };
  return [
    { x: times, y: low, ...line },
    { x: times, y: high, ...line, fill: "tonexty", fillcolor: `rgba(0, 103, 160, ${opacity})`, name, showlegend: shown },
  ];
}

// Where parts were replaced: all hours, or those of one component.
function replaced(curves, component) {
  const own = curves.replacements.filter(([, part]) => !component || part === component || part === "unit");
  return [...new Set(own.map(([hours]) => hours))];
}

function replacedLines(hours, axes) {
  return hours.map((x) => ({ type: "line", x0: x, x1: x, y0: 0, y1: 1, line: { color: GREY, width: 1, dash: "dashdot" }, ...axes }));
}

const REPLACED = { x: [null], y: [null], mode: "lines", line: { color: GREY, dash: "dashdot" }, name: "replaced" };

// From 0 to 1, and as far beyond as a friction falls below healthy.
function levelRange(curves, name) {
  const limits = curves.limits.filter(([component]) => component === name).map(([, bound]) => bound);
  const seen = curves.seen.map((one) => one.levels[name]);
  const known = [...curves.levels[name][0], ...limits, ...seen].filter((one) => one !== null);
  return [Math.min(0, ...known) - 0.03, 1.03];
}

function health(curves) {
  const names = Object.keys(curves.levels), columns = window.innerWidth < SMALL ? 1 : 2;
  const rows = Math.ceil(names.length / columns), traces = [], shapes = [], annotations = [];
  const layout = { grid: { rows, columns, pattern: "independent", ygap: 0.35, xgap: 0.12 } };
  names.forEach((name, i) => {
    const end = i ? String(i + 1) : "", axes = { xaxis: `x${end}`, yaxis: `y${end}` }, levels = curves.levels[name];
    traces.push(...band(curves.times, levels[0], levels[4], 0.18, axes, "forecast, 90 %", i === 0));
    traces.push(...band(curves.times, levels[1], levels[3], 0.35, axes, "forecast, 50 %", i === 0));
    traces.push({ x: curves.times, y: levels[2], mode: "lines", line: { color: BLUE, width: 1.5 },
      name: "forecast, median", showlegend: i === 0, ...axes });
    for (const explained of [true, false]) {
      const seen = curves.seen.filter((one) => one.explained === explained);
      if (!seen.length) continue;
      traces.push({ x: seen.map((one) => one.hours), y: seen.map((one) => one.levels[name]), mode: "markers",
        error_y: { type: "data", array: seen.map((one) => one.halves[name]), thickness: 1, width: 0 },
        marker: { color: explained ? "#333" : GREY, symbol: explained ? "circle" : "x", size: 5 },
        name: explained ? "diagnosis" : "diagnosis, not explained", showlegend: i === 0, ...axes });
    }
    for (const [component, bound] of curves.limits) {
      if (component === name) shapes.push({ type: "line", xref: `x${end} domain`, yref: `y${end}`, x0: 0, x1: 1, y0: bound, y1: bound,
        line: { color: VERMILION, width: 1, dash: "dash" } });
    }
    shapes.push(...replacedLines(replaced(curves, name), { xref: `x${end}`, yref: `y${end} domain` }));
    annotations.push({ text: `<b>${name}</b>`, xref: `x${end} domain`, yref: `y${end} domain`, x: 0, y: 1, yanchor: "bottom", showarrow: false });
    layout[`yaxis${end}`] = { range: levelRange(curves, name) };
    layout[`xaxis${end}`] = { title: i >= names.length - columns ? { text: "flight hours [h]" } : undefined };
  });
  traces.push({ x: [null], y: [null], mode: "lines", line: { color: VERMILION, dash: "dash" }, name: "limit" });
  if (curves.replacements.length) traces.push(REPLACED);
  return [traces, { ...layout, shapes, annotations, legend: { orientation: "h", y: -0.09, yanchor: "top" } }];
}

function life(curves) {
  const traces = [{ x: curves.risk_times, y: curves.risk, mode: "lines", line: { color: BLUE }, name: "any requirement" }];
  if (curves.first_label) {
    traces.push({ x: curves.risk_times, y: curves.first_risk, mode: "lines", line: { color: VERMILION, dash: "dash" },
      name: curves.first_label });
  }
  const end = curves.now + curves.horizon;
  const shapes = [{ type: "line", x0: end, x1: end, yref: "paper", y0: 0, y1: 1, line: { color: GREY, dash: "dot" } }];
  return [traces, { shapes, xaxis: { title: { text: "flight hours [h]" } },
    yaxis: { range: [0, 1.02], title: { text: "probability of failure" } }, legend: { orientation: "h", y: 1.15 } }];
}

function fan(curves) {
  // Life begins anew with a replacement: each part of the life is drawn by itself.
  const breaks = replaced(curves).filter((hours) => hours > curves.fan[0][0]).sort((a, b) => a - b);
  const parts = [-Infinity, ...breaks].map((from, i) => curves.fan.filter(([hours]) => hours > from && hours <= (breaks[i] ?? Infinity)));
  const traces = parts.filter((rows) => rows.length).flatMap((rows, i) => {
    const column = (j) => rows.map((row) => row[j]), hours = column(0), first = i === 0;
    const median = { x: hours, y: column(3), mode: "lines+markers", line: { color: BLUE }, name: "median", showlegend: first };
    if (rows.length > 1) {
      return [...band(hours, column(1), column(5), 0.18, {}, "90 %", first), ...band(hours, column(2), column(4), 0.35, {}, "50 %", first), median];
    }
    // A band of one forecast has no width.
    const [low, high] = [rows[0][3] - rows[0][1], rows[0][5] - rows[0][3]];
    return [{ ...median, error_y: { type: "data", symmetric: false, array: [high], arrayminus: [low], width: 4 }, name: "median, 90 %" }];
  });
  if (breaks.length) traces.push(REPLACED);
  // As the drawn figure: logarithmic where the shortest median could hardly be read along an even axis.
  const all = curves.fan.flatMap((row) => row.slice(1)), medians = curves.fan.map((row) => row[3]);
  const scale = Math.min(...all) > SHORT && Math.min(...medians) < LOW * Math.max(...all) ? { type: "log", dtick: 1 } : { rangemode: "tozero" };
  return [traces, { shapes: replacedLines(breaks, { yref: "paper" }), xaxis: { title: { text: "flight hours [h]" } },
    yaxis: { ...scale, title: { text: `RUL [h], at most ${curves.longest.toLocaleString("en")}` } }, legend: { orientation: "h", y: 1.15 } }];
}

async function zoom() {
  const places = [...document.querySelectorAll("figure[data-curves]")];
  if (!places.length || !window.Plotly) return;
  const answer = await fetch(places[0].dataset.curves);
  if (!answer.ok) return;
  const curves = await answer.json();
  const common = { margin: { l: 50, r: 10, t: 30, b: 45 }, font: { family: "system-ui, sans-serif", size: 12 },
    hovermode: "closest", dragmode: "zoom" };
  for (const place of places) {
    const image = place.querySelector("img"), plot = document.createElement("div");
    const [traces, layout] = { health, life, fan }[place.dataset.plot](curves);
    plot.className = `zoom zoom-${place.dataset.plot}`;
    plot.setAttribute("role", "img");
    plot.setAttribute("aria-label", image.alt);
    image.parentElement.replaceWith(plot);
    await Plotly.newPlot(plot, traces, { ...common, ...layout }, { responsive: true, displayModeBar: false });
    const hint = document.createElement("span");
    hint.textContent = " Drag to zoom, double-click to go back.";
    place.querySelector("figcaption").append(hint);
  }
}

zoom();
