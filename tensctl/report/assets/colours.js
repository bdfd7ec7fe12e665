// Colours of the canvas drawings. The page's CSS has the same ones; a canvas cannot use CSS variables, and printing
// wants the light ones whatever the screen shows.

const DEPTH_LEVELS = 6;
const RAMP_STEPS = 128;

function parseHex(hex) {
  return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
}

function mix(a, b, share) {
  return a.map((x, k) => Math.round(x + (b[k] - x) * share));
}

function css(rgb) {
  return `rgb(${rgb[0]} ${rgb[1]} ${rgb[2]})`;
}

// Distant things fade towards the paper by at most 45 %, which reads as depth and keeps them visible.
function faded(rgb, paper) {
  const levels = [];
  for (let k = 0; k < DEPTH_LEVELS; k++) {
    levels.push(css(mix(rgb, paper, 0.45 * (1 - k / (DEPTH_LEVELS - 1)))));
  }
  return levels;
}

function alongRamp(stops, steps) {
  const colours = [];
  for (let k = 0; k < steps; k++) {
    const place = (k / (steps - 1)) * (stops.length - 1);
    const below = Math.min(Math.floor(place), stops.length - 2);
    colours.push(mix(stops[below], stops[below + 1], place - below));
  }
  return colours;
}

// inks: name -> hex for one kind of paper. The result holds CSS colours; those of members come as lists over depth,
// far to near.
function makeTheme(inks) {
  const rgb = (name) => parseHex(inks[name]);
  const paper = rgb("card");
  const stops = [];
  while (inks["ramp-" + stops.length]) stops.push(rgb("ramp-" + stops.length));
  const grey = rgb("faint");
  const diverging = alongRamp([rgb("blue"), grey, rgb("orange")], RAMP_STEPS);
  return {
    paper: css(paper),
    text: css(rgb("text")),
    muted: css(rgb("muted")),
    rule: css(rgb("rule")),
    ghost: css(rgb("ghost")),
    faint: css(mix(rgb("faint"), paper, 0.35)),
    push: css(rgb("bad")),
    rod: faded(rgb("rod"), paper),
    rodLight: faded(rgb("rod-light"), paper),
    slack: faded(rgb("slack"), paper),
    plain: faded(rgb("muted"), paper),
    ramp: alongRamp(stops, RAMP_STEPS).map((colour) => faded(colour, paper)),
    diverging: diverging.map((colour) => faded(colour, paper)),
  };
}

// The themes of a page: the one that fits the screen now, the light one while printing.
class Themes {
  constructor(palette, changed) {
    this.light = makeTheme(palette.light);
    this.dark = makeTheme(palette.dark);
    this.printing = false;
    this.wish = window.matchMedia("(prefers-color-scheme: dark)");
    this.wish.addEventListener("change", changed);
    const print = (printing) => () => {
      this.printing = printing;
      changed();
    };
    window.addEventListener("beforeprint", print(true));
    window.addEventListener("afterprint", print(false));
  }

  get now() {
    return this.wish.matches && !this.printing ? this.dark : this.light;
  }
}
