"use strict";
// Turns the model by drag or arrow keys. The page is whole without it.
(() => {
  const data = document.getElementById("mesh");
  const canvas = document.getElementById("turn");
  if (!data || !canvas || !canvas.getContext) return;
  const { vertices, triangles } = JSON.parse(data.textContent);
  const count = vertices.length / 3;
  const radius = Math.max(...Array.from({ length: count }, (_, i) =>
    Math.hypot(vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2])));
  const context = canvas.getContext("2d");
  let yaw = 0.5, pitch = 0.35;

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    const side = canvas.clientWidth * ratio;
    if (canvas.width !== side) canvas.width = canvas.height = side;
    const scale = 0.49 * side / radius, middle = side / 2;
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const seen = new Float64Array(3 * count);
    for (let i = 0; i < count; i++) {
      const [x, y, z] = [vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]];
      // The patient faces the eye: right is left (x), up is superior (z), near is anterior (-y).
      const right = cy * x - sy * y, away = sy * x + cy * y;
      seen[3 * i] = right;
      seen[3 * i + 1] = cp * z + sp * away;
      seen[3 * i + 2] = sp * z - cp * away;
    }
    const front = [];
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
      const ux = seen[b] - seen[a], uy = seen[b + 1] - seen[a + 1], uz = seen[b + 2] - seen[a + 2];
      const vx = seen[c] - seen[a], vy = seen[c + 1] - seen[a + 1], vz = seen[c + 2] - seen[a + 2];
      const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      if (nz <= 0) continue;
      const length = Math.hypot(nx, ny, nz);
      const key = Math.max(0, (-0.45 * nx + 0.6 * ny + 0.66 * nz) / length);
      const fill = Math.max(0, (0.7 * nx - 0.4 * ny + 0.59 * nz) / length);
      front.push([seen[a + 2] + seen[b + 2] + seen[c + 2], 0.34 + 0.62 * key + 0.16 * fill, a, b, c]);
    }
    front.sort((p, q) => p[0] - q[0]);
    context.clearRect(0, 0, side, side);
    context.lineJoin = "round";
    context.lineWidth = Math.min(1.2 * ratio, side / Math.sqrt(triangles.length) / 18);
    for (const [, light, ...corners] of front) {
      context.beginPath();
      for (const v of corners) context.lineTo(middle + scale * seen[v], middle - scale * seen[v + 1]);
      context.closePath();
      const shade = (share) => `rgb(${[230, 107, 92].map((c) => Math.min(255, c * light * share)).join(" ")})`;
      context.fillStyle = shade(1);
      context.fill();
      context.strokeStyle = shade(0.42);
      context.stroke();
    }
  }

  function turn(dx, dy) {
    yaw += dx;
    pitch = Math.max(-1.57, Math.min(1.57, pitch + dy));
    requestAnimationFrame(draw);
  }

  let last = null;
  canvas.addEventListener("pointerdown", (event) => {
    last = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!last) return;
    turn((event.clientX - last[0]) / 120, (event.clientY - last[1]) / 120);
    last = [event.clientX, event.clientY];
  });
  canvas.addEventListener("pointerup", () => { last = null; });
  canvas.addEventListener("pointercancel", () => { last = null; });
  canvas.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    if (!steps[event.key]) return;
    event.preventDefault();
    turn(...steps[event.key]);
  });
  document.getElementById("turnable").hidden = false;
  window.addEventListener("resize", draw);
  draw();
})();
