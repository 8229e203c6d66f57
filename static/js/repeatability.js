// How the corners scatter while the sensor stands still, against what each method claims.

export function mountRepeatability() {}
