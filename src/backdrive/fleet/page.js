"use strict";
const joints = JSON.parse(document.getElementById("data").textContent).joints;
const grid = document.getElementById("grid"), search = document.getElementById("search");
const kind = document.getElementById("kind"), count = document.getElementById("count"), one = document.getElementById("one");
const WIDE = 170, HIGH = 92, GAP = 6;
let view = joints, drawn = new Map();

const date = (day) => new Date(day * 86400000).toISOString().slice(0, 10);
const element = (name, attributes, text) => {
  const made = name[0] === "/" ? document.createElementNS("http://www.w3.org/2000/svg", name.slice(1)) : document.createElement(name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  return made;
};

// Points of a course, 0 to 1 from left to right and from low to high; null where there is no value.
function course(joint) {
  const bytes = atob(joint.y), last = Math.max(bytes.length - 1, 1), points = [];
  for (let i = 0; i < bytes.length; i++) {
    const value = bytes.charCodeAt(i);
    points.push(value === 255 ? null : [i / last, value / 254]);
  }
  return points;
}

function line(joint, width, height, left = 0, top = 0) {
  return course(joint).filter((point) => point)
    .map((point, i) => (i ? "L" : "M") + (left + point[0] * width).toFixed(1) + " " + (top + (1 - point[1]) * height).toFixed(1)).join("");
}

function card(joint) {
  const made = element("button", { class: "card" + ["", " apart", " changed", " silent"][joint.k], title: joint.s });
  const picture = element("/svg", { width: "100%", height: 38, viewBox: "0 0 100 38", preserveAspectRatio: "none", "aria-hidden": "true" });
  picture.append(element("/path", { d: line(joint, 100, 34, 0, 2) }));
  made.append(element("b", {}, joint.n), picture, element("small", {}, joint.z === undefined ? `${joint.r[0]} to ${joint.r[1]} ${joint.u}` : `no result since ${date(joint.d[1])}`));
  made.addEventListener("click", () => open(joint));
  return made;
}

function columns() {
  return Math.max(Math.floor((grid.clientWidth + GAP) / (WIDE + GAP)), 2);
}

// Only what can be seen is in the page.
function draw() {
  const across = columns(), width = (grid.clientWidth + GAP) / across - GAP;
  grid.style.height = Math.ceil(view.length / across) * (HIGH + GAP) + "px";
  const top = window.scrollY - grid.offsetTop;
  const first = Math.max(Math.floor(top / (HIGH + GAP)) - 2, 0) * across;
  const last = Math.min((Math.ceil((top + window.innerHeight) / (HIGH + GAP)) + 2) * across, view.length);
  const next = new Map();
  for (let i = first; i < last; i++) {
    const joint = view[i], made = drawn.get(joint) || card(joint);
    made.style.cssText = `left:${(i % across) * (width + GAP)}px;top:${Math.floor(i / across) * (HIGH + GAP)}px;width:${width}px;height:${HIGH}px`;
    if (!drawn.has(joint)) grid.append(made);
    drawn.delete(joint);
    next.set(joint, made);
  }
  for (const made of drawn.values()) made.remove();
  drawn = next;
}

function choose() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean), which = Number(kind.value);
  view = joints.filter((joint) => words.every((word) => joint.n.toLowerCase().includes(word)) &&
    (which === 0 || (which === 2 ? joint.k === 2 : which === 3 ? joint.z !== undefined : joint.a !== undefined)));
  count.textContent = `${view.length} of ${joints.length}`;
  window.scrollTo(0, 0);
  draw();
}

function open(joint) {
  const W = 700, H = 240, L = 56, T = 10, w = W - L - 10, h = H - T - 26;
  const picture = element("/svg", { viewBox: `0 0 ${W} ${H}`, width: "100%", role: "img", "aria-label": "history" });
  const at = (day) => L + ((day - joint.d[0]) / Math.max(joint.d[1] - joint.d[0], 1)) * w;
  if (joint.o) {
    picture.append(element("/rect", { class: "band", x: at(joint.o[1]), y: T, width: Math.max(at(joint.o[2]) - at(joint.o[1]), 2), height: h }));
    picture.append(element("/line", { x1: at(joint.o[0]), x2: at(joint.o[0]), y1: T, y2: T + h, stroke: "var(--red)" }));
  }
  picture.append(element("/line", { class: "axis", x1: L, x2: L + w, y1: T + h, y2: T + h }), element("/path", { d: line(joint, w, h, L, T) }));
  for (const [y, value] of [[T + 10, joint.r[1]], [T + h, joint.r[0]]]) picture.append(element("/text", { x: L - 6, y, "text-anchor": "end" }, value));
  picture.append(element("/text", { x: L, y: H - 6 }, date(joint.d[0])), element("/text", { x: L + w, y: H - 6, "text-anchor": "end" }, date(joint.d[1])));
  const close = element("button", {}, "Close");
  close.addEventListener("click", () => one.close());
  one.replaceChildren(element("h2", { id: "name" }, joint.n), picture,
    element("p", {}, `Friction at ${joint.v} ${joint.u === "N.m" ? "rad/s" : "m/s"} [${joint.u}]: ${joint.s}.`));
  if (joint.z) one.append(element("p", {}, `Of this joint there is ${joint.z}.`));
  if (joint.a) one.append(element("p", {}, `Unlike its siblings: ${joint.a}.`));
  one.append(element("p", {}, `Last: constant ${joint.l[0]}, viscous ${joint.l[1]}.`));
  if (joint.h) one.append(element("p", {}, "")), one.lastChild.append(element("a", { href: joint.h }, "Report of the last log"));
  else if (joint.p) one.append(element("p", {}, "Report of the last log: "), element("code", {}, `backdrive identify '${joint.p}' --report report.html`));
  one.append(element("p", {}), close);
  one.showModal();
}

let waits = false;
const later = () => { if (!waits) { waits = true; requestAnimationFrame(() => { waits = false; draw(); }); } };
addEventListener("scroll", later, { passive: true });
addEventListener("resize", later);
search.addEventListener("input", choose);
kind.addEventListener("change", choose);
choose();
