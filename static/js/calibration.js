// The noise of this sensor: measured, saved and chosen.

export function mountCalibration() {}
