// A line at the time of the animation in every plot over time; pressing on a plot moves the animation there.

function followTime(figure, player) {
  const svg = figure.querySelector("svg");
  const [begin, end, left, right, top, bottom] = figure.dataset.span.split(" ").map(Number);
  const cursor = document.createElementNS(svg.namespaceURI, "path");
  cursor.setAttribute("class", "cursor");
  svg.append(cursor);
  player.followers.push((time) => {
    const share = (time - begin) / (end - begin);
    const x = left + share * (right - left);
    cursor.setAttribute("d", share < 0 || share > 1 ? "" : `M${x.toFixed(1)} ${top}V${bottom}`);
  });
  const goTo = (event) => {
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    player.seek(begin + ((place.x - left) / (right - left)) * (end - begin));
  };
  svg.addEventListener("pointerdown", (event) => {
    svg.setPointerCapture(event.pointerId);
    goTo(event);
  });
  svg.addEventListener("pointermove", (event) => event.buttons && goTo(event));
}
