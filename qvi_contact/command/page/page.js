// Draws the field of the page and shows the values under the pointer. All data are in the element "data"; nothing is loaded.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const find = (id) => document.getElementById(id);
  const array = (text, Kind) => new Kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
  const show = (value) => (value === null || Number.isNaN(value) ? "–" : String(Number(value.toPrecision(4))).replace("-", "−"));

  const coordinates = (x, y, size) => { // to four digits of the size of the body or contact, wherever the origin is
    const digits = Math.min(Math.max(4 - Math.floor(Math.log10(size)), 0), 100);
    return ["x", "y"].map((name, c) => `${name} = ${String(Number([x, y][c].toFixed(digits))).replace("-", "−")}`).join(", ");
  };

  const contactPictures = () => {
    for (const box of document.querySelectorAll("[data-contact]")) {
      const contact = data.contacts[box.dataset.contact], picture = box.querySelector("img");
      const output = box.closest("figure").querySelector("output"), marker = document.createElement("div");
      const { length, stress } = contact.units;
      const say = (nearest) => {
        output.textContent = `${coordinates(contact.x[nearest], contact.y[nearest], contact.high - contact.low)} ${length}: ${contact.state[nearest]}; `
          + `${contact.fluid ? `fluid ${show(contact.fluid[nearest])}, effective ` : ""}pressure ${show(contact.pressure[nearest])}, σ_T ${show(contact.shear[nearest])}, bound ${show(contact.bound[nearest])} ${stress}; `
          + `gap ${show(contact.gap[nearest])}, slip ${show(contact.slip[nearest])} ${length}`;
      };
      marker.className = "marker";
      marker.hidden = true;
      box.append(marker);
      box.addEventListener("pointermove", (event) => {
        const area = picture.getBoundingClientRect(), span = contact.right - contact.left;
        const share = ((event.clientX - area.left) / area.width - contact.left) / span;
        const pointed = contact.low + share * (contact.high - contact.low);
        let nearest = 0;
        contact.s.forEach((s, point) => { if (Math.abs(s - pointed) < Math.abs(contact.s[nearest] - pointed)) nearest = point; });
        const across = contact.left + span * (contact.s[nearest] - contact.low) / (contact.high - contact.low);
        marker.style.left = `${area.left - box.getBoundingClientRect().left - box.clientLeft + across * area.width}px`;
        marker.hidden = false;
        say(nearest);
      });
      box.addEventListener("pointerleave", () => { marker.hidden = true; });
    }
  };

  const slider = find("step"), pictures = [...document.querySelectorAll(".step")];
  if (slider) slider.addEventListener("input", () => {
    pictures.forEach((picture, number) => { picture.hidden = number !== Number(slider.value); });
    find("step-value").textContent = pictures[slider.value].dataset.value;
  });

  const fieldPicture = (field) => {
    const points = array(field.points, Float32Array), triangles = array(field.triangles, Uint32Array);
    const stress = array(field.stress, Float32Array), alongZ = field.alongZ && array(field.alongZ, Float32Array);
    const moved = field.displacement && array(field.displacement, Float32Array);
    const lines = ({ points: text, displacement }) => ({ ends: array(text, Float32Array), moved: displacement && array(displacement, Float32Array) });
    const outline = lines(field.outline), mesh = lines(field.mesh), contacts = field.contacts.map(lines);
    const canvas = find("drawing"), context = canvas.getContext("2d"), count = points.length / 2;
    const mean = (xx, yy) => (xx + yy) / 2, radius = (xx, yy, xy) => Math.hypot((xx - yy) / 2, xy);
    const mises = (xx, yy, xy, zz) => Math.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy * xy);
    const { length, stress: unit } = field.units;
    const quantities = {
      "von Mises stress": [unit, mises],
      "σ_xx": [unit, (xx) => xx], "σ_yy": [unit, (xx, yy) => yy], "σ_xy": [unit, (xx, yy, xy) => xy],
      "largest principal stress": [unit, (xx, yy, xy) => mean(xx, yy) + radius(xx, yy, xy)],
      "smallest principal stress": [unit, (xx, yy, xy) => mean(xx, yy) - radius(xx, yy, xy)],
    };
    if (moved) {
      quantities["u_x"] = [length, (xx, yy, xy, zz, ux) => ux];
      quantities["u_y"] = [length, (xx, yy, xy, zz, ux, uy) => uy];
    }
    const at = (function_, p) => function_(stress[3 * p], stress[3 * p + 1], stress[3 * p + 2], alongZ ? alongZ[p] : 0,
      moved ? moved[2 * p] : 0, moved ? moved[2 * p + 1] : 0);

    let values = new Float32Array(count), low = 0, high = 1, colours = field.colours.cividis, scale = 0;
    let view = null, picked = new Int32Array(0), screen = new Float32Array(2 * count), queued = false;

    const choose = () => { // values and the range of colours, which a few much larger values, as in corners, do not change
      const [unitOf, function_] = quantities[find("quantity").value];
      values = Float32Array.from({ length: count }, (_, p) => at(function_, p));
      const sorted = Float32Array.from(values).sort(), least = sorted[0], most = sorted[count - 1];
      const usual = [sorted[Math.floor(0.01 * count)], sorted[Math.floor(0.99 * (count - 1))]];
      const size = Math.max(Math.abs(least), Math.abs(most)), few = Math.max(Math.abs(usual[0]), Math.abs(usual[1]));
      const end = few < 0.7 * size ? few : size;
      if (least < -1e-6 * size && most > 1e-6 * size) [low, high, colours] = [-end, end, field.colours.PuOr_r];
      else {
        [low, high] = [Math.max(least, -end), Math.min(most, end)];
        if (high - low <= 1e-6 * size) [low, high] = [low - (0.05 * size || 1), high + (0.05 * size || 1)];
        colours = high > -low ? field.colours.cividis : field.colours.cividis_r;
      }
      find("ramp").style.background = `linear-gradient(to right, ${colours.map((colour) => `rgb(${colour})`).join()})`;
      find("low").textContent = `${show(low)}${least < low ? `, down to ${show(least)}` : ""}`;
      find("high").textContent = `${show(high)}${most > high ? `, up to ${show(most)}` : ""} ${unitOf}`;
    };

    const fit = () => { // the whole body in the middle
      let [left, right, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
      for (let p = 0; p < count; p += 1) {
        const x = points[2 * p] + (moved ? scale * moved[2 * p] : 0), y = points[2 * p + 1] + (moved ? scale * moved[2 * p + 1] : 0);
        [left, right, bottom, top] = [Math.min(left, x), Math.max(right, x), Math.min(bottom, y), Math.max(top, y)];
      }
      const zoom = 0.92 * Math.min(canvas.clientWidth / (right - left), canvas.clientHeight / (top - bottom));
      view = { x: (left + right) / 2, y: (bottom + top) / 2, zoom, whole: zoom };
    };

    const segments = ({ ends, moved: shifts }, ratio, style, width) => {
      const end = (k) => toScreen(ends[k] + (shifts ? scale * shifts[k] : 0), ends[k + 1] + (shifts ? scale * shifts[k + 1] : 0), ratio);
      context.beginPath();
      for (let k = 0; k < ends.length; k += 4) {
        context.moveTo(...end(k));
        context.lineTo(...end(k + 2));
      }
      context.strokeStyle = style;
      context.lineWidth = width * ratio;
      context.stroke();
    };
    const toScreen = (x, y, ratio) => [canvas.width / 2 + (x - view.x) * view.zoom * ratio, canvas.height / 2 - (y - view.y) * view.zoom * ratio];

    const fill = (image, width, height) => { // linear interpolation in each triangle, pixel by pixel
      const pixels = new Uint32Array(image.data.buffer), last = colours.length - 1;
      const ramp = Uint32Array.from({ length: 256 }, (_, k) => {
        const t = (k / 255) * last, first = Math.min(Math.floor(t), last - 1), share = t - first;
        const [red, green, blue] = colours[first].map((part, c) => Math.round(part + share * (colours[first + 1][c] - part)));
        return 0xff000000 | (blue << 16) | (green << 8) | red;
      });
      for (let k = 0; k < triangles.length; k += 3) {
        const [a, b, c] = [triangles[k], triangles[k + 1], triangles[k + 2]];
        const ax = screen[2 * a], ay = screen[2 * a + 1], bx = screen[2 * b], by = screen[2 * b + 1], cx = screen[2 * c], cy = screen[2 * c + 1];
        const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
        const left = Math.max(0, Math.floor(Math.min(ax, bx, cx))), right = Math.min(width - 1, Math.ceil(Math.max(ax, bx, cx)));
        const top = Math.max(0, Math.floor(Math.min(ay, by, cy))), bottom = Math.min(height - 1, Math.ceil(Math.max(ay, by, cy)));
        if (area === 0) continue;
        for (let y = top; y <= bottom; y += 1) {
          for (let x = left; x <= right; x += 1) {
            const second = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area, third = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area;
            if (second < -1e-6 || third < -1e-6 || second + third > 1 + 1e-6) continue;
            const value = values[a] + second * (values[b] - values[a]) + third * (values[c] - values[a]);
            const level = Math.round((255 * (value - low)) / (high - low));
            pixels[y * width + x] = ramp[level < 0 ? 0 : level > 255 ? 255 : level];
            picked[y * width + x] = k;
          }
        }
      }
    };

    const draw = () => {
      queued = false;
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
      if (!view) fit();
      for (let p = 0; p < count; p += 1) {
        const place = toScreen(points[2 * p] + (moved ? scale * moved[2 * p] : 0), points[2 * p + 1] + (moved ? scale * moved[2 * p + 1] : 0), ratio);
        [screen[2 * p], screen[2 * p + 1]] = place;
      }
      const image = context.createImageData(width, height);
      picked = new Int32Array(width * height).fill(-1);
      fill(image, width, height);
      context.putImageData(image, 0, 0);
      if (find("lines").checked) segments(mesh, ratio, "rgba(255, 255, 255, 0.6)", 0.7);
      segments(outline, ratio, "#666", 1);
      for (const contact of contacts) segments(contact, ratio, "#000", 2.5);
    };
    const later = () => { if (!queued) { queued = true; requestAnimationFrame(draw); } };

    const within = (event) => {
      const area = canvas.getBoundingClientRect();
      return [event.clientX - area.left - canvas.clientLeft, event.clientY - area.top - canvas.clientTop];
    };
    const say = (event) => {
      const [x, y] = within(event), ratio = canvas.width / canvas.clientWidth;
      const column = Math.round(x * ratio), row = Math.round(y * ratio);
      const inside = column >= 0 && row >= 0 && column < canvas.width && row < canvas.height;
      const k = inside ? picked[row * canvas.width + column] : -1;
      if (k < 0) return;
      const corners = [triangles[k], triangles[k + 1], triangles[k + 2]];
      const [[ax, ay], [bx, by], [cx, cy]] = corners.map((p) => [screen[2 * p], screen[2 * p + 1]]);
      const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
      const second = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area, third = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area;
      const between = (of) => { const [one, two, three] = corners.map(of); return one + second * (two - one) + third * (three - one); };
      const name = find("quantity").value, [unitOf] = quantities[name];
      const [px, py] = [0, 1].map((c) => between((p) => points[2 * p + c])), parts = [0, 1, 2].map((c) => between((p) => stress[3 * p + c]));
      let text = `${coordinates(field.origin[0] + px, field.origin[1] + py, field.size)} ${length}: ${name} ${show(between((p) => values[p]))} ${unitOf}; `
        + `σ_xx ${show(parts[0])}, σ_yy ${show(parts[1])}, σ_xy ${show(parts[2])} ${unit}`;
      if (moved) text += `; u = (${[0, 1].map((c) => show(between((p) => moved[2 * p + c]))).join(", ")}) ${length}`;
      find("value").textContent = text;
    };

    const zoom = (by, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) => { // the point (x, y) stays where it is
      const next = Math.min(Math.max(view.zoom * by, 0.5 * view.whole), 2000 * view.whole);
      view.x += (x - canvas.clientWidth / 2) * (1 / view.zoom - 1 / next);
      view.y -= (y - canvas.clientHeight / 2) * (1 / view.zoom - 1 / next);
      view.zoom = next;
      later();
    };
    const shift = (x, y) => { view.x -= x / view.zoom; view.y += y / view.zoom; later(); };
    const whole = () => { fit(); later(); };

    for (const name of Object.keys(quantities)) find("quantity").append(new Option(name, name));
    find("quantity").addEventListener("change", () => { choose(); later(); });
    find("lines").addEventListener("change", later);
    find("closer").addEventListener("click", () => zoom(1.5));
    find("farther").addEventListener("click", () => zoom(1 / 1.5));
    find("whole").addEventListener("click", whole);
    if (moved) {
      find("deform").hidden = false;
      find("factor").value = "0";
      find("factor").max = String(100 * field.factorOfDisplacement);
      find("factor").step = String(field.factorOfDisplacement / 5);
      find("factor").addEventListener("input", (event) => { scale = Number(event.target.value) || 0; later(); });
    }
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 400), ...within(event)); }, { passive: false });
    let held = null;
    canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); say(event); });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointercancel", () => { held = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (held) { shift(event.clientX - held[0], event.clientY - held[1]); held = [event.clientX, event.clientY]; } else say(event);
    });
    const keys = {
      "+": () => zoom(1.5), "=": () => zoom(1.5), "-": () => zoom(1 / 1.5), 0: whole,
      ArrowLeft: () => shift(40, 0), ArrowRight: () => shift(-40, 0), ArrowUp: () => shift(0, 40), ArrowDown: () => shift(0, -40),
    };
    canvas.addEventListener("keydown", (event) => { if (keys[event.key]) { event.preventDefault(); keys[event.key](); } });
    new ResizeObserver(() => { view = null; later(); }).observe(canvas);
    choose();
    draw();
  };

  contactPictures();
  if (data.field) fieldPicture(data.field);
})();
