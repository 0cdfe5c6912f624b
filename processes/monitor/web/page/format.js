// Colours and words that several parts of the page share.
const COLOURS = {
  POSE_FUSED: '#0f9d6b', POSE_INS: '#2f6fed', POSE_VO: '#9153d6', POSE_WHEEL: '#dd8020', POSE_LOCAL: '#c9487f',
  POSE_VO_MAP: '#6d5bd0', REFERENCE: '#8a94a6',
};
const NAMES = {
  POSE_FUSED: 'Fused', POSE_INS: 'GNSS + inertial', POSE_VO: 'Camera', POSE_WHEEL: 'Wheels', POSE_LOCAL: 'Fused, never jumps',
  POSE_VO_MAP: 'Camera map', REFERENCE: 'Truth',
};

const MEANINGS = {
  CAMERA_LEFT: 'pictures of the camera', CAMERA_RIGHT: 'pictures of the right camera', GNSS: 'satellite receiver', IMU: 'accelerations and turn rates',
  MAG: 'compass', WHEELS: 'wheel speeds', POSE_FUSED: 'the fused estimate', POSE_LOCAL: 'the fused one without its jumps', POSE_INS: 'estimate of GNSS + inertial',
  POSE_VO: 'estimate of the camera', POSE_VO_MAP: 'the same in its map’s frame', POSE_WHEEL: 'estimate of the wheels', VO_FEATURES: 'points in the picture',
  VO_STATUS: 'how the camera’s estimate goes', INS_STATUS: 'how GNSS + inertial goes', FUSION_STATE: 'what the fusion uses', REFERENCE: 'the truth, to compare',
  recorder: 'writes the log', gnss_ins_ekf: 'estimates by GNSS + inertial', wheel_odometry: 'estimates by the wheels', vo_tracker: 'estimates by the camera',
  imm_fusion: 'fuses the estimates', monitor: 'this page and the verdict',
  camera_driver: 'reads the camera', gnss_driver: 'reads the receiver', imu_driver: 'reads the IMU', wheel_driver: 'reads the wheels',
};

export const describe = (name) => MEANINGS[name] || '';
export const colour = (name) => COLOURS[name] || '#607080';
export const title = (name) => NAMES[name] || name;
export const metres = (x) => (x == null ? '–' : x < 1 ? `${(100 * x).toFixed(0)} cm` : `${x.toFixed(x < 10 ? 1 : 0)} m`);
export const fixed = (x, digits) => (x == null ? '–' : x.toFixed(digits));
export const clock = (ms) => new Date(ms).toISOString().slice(11, 19);

export function duration(s) {
  if (s < 60) return `${Math.floor(s)} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${Math.floor(s % 60)} s`;
  return `${Math.floor(s / 3600)} h ${Math.floor((s / 60) % 60)} min`;
}

/** An element with text; whatever comes from the bus is text, never markup. */
export function element(tag, text = '', attributes = {}) {
  const e = document.createElement(tag);
  e.textContent = text;
  for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
  return e;
}

/** A canvas at the device's own resolution: its context, in CSS pixels, and its size. */
export function canvas2d(canvas) {
  const box = canvas.getBoundingClientRect();
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, Math.round(box.width * ratio)), height = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const g = canvas.getContext('2d');
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { g, width: box.width, height: box.height };
}

export const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
