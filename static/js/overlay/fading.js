// The points of the last scans, which fade out: copies of what viser shows, made as it changes, in this browser only.

const CUSTOM_BLENDING = 5; // these as three.js numbers them
const CONSTANT_ALPHA = 213;
const ONE_MINUS_CONSTANT_ALPHA = 214;
const LESS_DEPTH = 2; // so that what is measured now lies on top
const STRONGEST = 0.6; // opacity of the scan before
const NODE = "/body/points";

export class Fading {
  #ghosts = []; // the newest first
  #seen = null; // positions that viser shows
  #version = 0; // of them

  /** `count()` tells how many scans fade. */
  constructor(count) {
    this.count = count;
  }

  /** Looks, before a picture is drawn, whether there is a new scan. */
  tick({ nodeRefFromName }) {
    const points = pointsOf(nodeRefFromName[NODE]);
    if (!points) return;
    const kept = this.count() && this.count() + 1; // the scan that is shown is the first of them
    const { array, version } = points.geometry.attributes.position;
    const isNew = kept && (array !== this.#seen || version !== this.#version);
    if (!isNew && this.#ghosts.length <= kept) return;
    [this.#seen, this.#version] = kept ? [array, version] : [null, 0];
    if (isNew) this.#ghosts.unshift(ghostOf(points));
    for (const ghost of this.#ghosts.splice(kept)) remove(ghost);
    this.#ghosts.forEach(({ material }, age) => (material.blendAlpha = STRONGEST * (1 - age / kept)));
  }
}

function pointsOf(node) {
  let found = null;
  node?.traverse((part) => (found ??= part.isPoints && !part.userData.isGhost ? part : null));
  return found;
}

/** A copy that stays as the points are now, beside them. */
function ghostOf(points) {
  const ghost = points.clone();
  ghost.geometry = points.geometry.clone();
  ghost.material = points.material.clone();
  Object.assign(ghost.material, {
    transparent: true,
    depthWrite: false,
    depthFunc: LESS_DEPTH,
    blending: CUSTOM_BLENDING,
    blendSrc: CONSTANT_ALPHA,
    blendDst: ONE_MINUS_CONSTANT_ALPHA,
  });
  ghost.userData.isGhost = true;
  points.parent.add(ghost);
  return ghost;
}

function remove(ghost) {
  ghost.removeFromParent();
  ghost.geometry.dispose();
  ghost.material.dispose();
}
