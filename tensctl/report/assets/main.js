// Brings the page to life: reads the data that the page carries, then starts what is there.

function read(id) {
  return JSON.parse(document.getElementById(id).textContent);
}

document.documentElement.classList.add("alive");
const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
const drawn = [];
const themes = new Themes(read("palette"), () => drawn.forEach((draw) => draw()));
const motion = new Motion(read("motion-data"));
const player = new Player(document.getElementById("viewer"), motion, themes);
drawn.push(() => player.drawNow());
for (const figure of document.querySelectorAll("figure[data-span]")) followTime(figure, player);
player.show();
if (!calm) player.playWhenSeen();

const modeViewer = document.getElementById("mode-viewer");
if (modeViewer) drawn.push(startModes(modeViewer, read("mode-data"), motion, themes, calm));
