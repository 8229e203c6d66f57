// The page, wired together: modules are mounted, then the stream feeds the store they read from.

import { request } from "./api.js";
import { mountCalibration } from "./calibration.js";
import { mountColours } from "./colours.js";
import { mountClusters } from "./clusters.js";
import { mountCorners } from "./corners.js";
import { mountDevice } from "./device.js";
import { mountDevices } from "./devices.js";
import { mountDial } from "./dial.js";
import { mountFaults } from "./faults.js";
import { mountFilter } from "./filter.js";
import { mountHeader } from "./header.js";
import { forget, remember } from "./history.js";
import { mountInspector } from "./inspector.js";
import { mountLandmark } from "./landmark.js";
import { mountLandmarks, receiveLandmarks } from "./landmarks.js";
import { mountLink } from "./link.js";
import { noneMapped, receiveMapped } from "./mapped.js";
import { mountMappedTable } from "./mapped-table.js";
import { mountMaking } from "./making.js";
import { mountMaps } from "./maps.js";
import { mountMask } from "./mask.js";
import { mountMethod } from "./method.js";
import { mountNavigation } from "./navigation.js";
import { mountOverlay } from "./overlay/overlay.js";
import { mountTools } from "./overlay/tools.js";
import { mountParameters } from "./parameters.js";
import { mountPlots } from "./plots.js";
import { mountRecordings } from "./recordings.js";
import { mountRejections } from "./rejections.js";
import { mountRepeatability } from "./repeatability.js";
import { isNewRun } from "./run.js";
import { fitScene, mountScene } from "./scene.js";
import { fieldsOf } from "./schema.js";
import { attempt, isPlaying, settings, transport } from "./actions.js";
import { mountShortcuts, press } from "./shortcuts.js";
import { mountSimulation } from "./simulation.js";
import { mountSource } from "./source.js";
import { get, set } from "./store.js";
import { connect } from "./stream.js";
import { mountTabs } from "./tabs.js";
import { bringPreference, keepTheme, mountTheme } from "./theme.js";
import { mountTimeline } from "./timeline.js";
import { clearToasts } from "./toasts.js";
import { mountUpload } from "./upload.js";
import { mountView } from "./view.js";
import { mountWelcome } from "./welcome.js";

mountTheme();
mountColours();
mountTabs();
mountHeader();
mountTools();
mountScene(press);
mountOverlay();
mountDial();
mountTimeline();
mountMethod();
mountView();
mountParameters();
mountCalibration();
mountMask();
mountClusters();
mountNavigation();
mountLandmarks();
mountLandmark();
mountMappedTable();
mountMaps();
mountFilter();
mountCorners();
mountPlots();
mountRepeatability();
mountInspector();
mountSource();
mountSimulation();
mountDevice();
mountFaults();
mountDevices();
mountRecordings();
mountMaking();
mountUpload();
mountRejections();
mountShortcuts();
mountWelcome();

set("opening", null);
set("wall", null);
noneMapped();
connect({ onOpen: join, onState: accept, onFrame: show, onLandmarks: receiveLandmarks, onWalls: receiveMapped });

let joining; // no frame has come yet over this connection

function join() {
  joining = true;
  noneMapped();
  clearToasts("connection");
  keepTheme();
  learn();
}

/** What never changes while a server runs; asked for once, at the first connection that succeeds. */
async function learn() {
  if (get("fields")) return;
  await attempt(async () => {
    const [methods, schema] = await Promise.all([
      request("GET", "methods"),
      request("GET", "settings/schema"),
    ]);
    set("methods", methods.fitters);
    set("clusterers", methods.clusterers);
    set("fields", fieldsOf(schema));
    await begin();
  });
}

let known;
const firstState = new Promise((resolve) => (known = resolve));

async function begin() {
  await firstState;
  await bringPreference();
  await mountLink();
}

function accept(state) {
  settings.accept(state.settings);
  transport.accept(state.source);
  set("selection", state.selection);
  set("localization", state.localization);
  set("recorder", state.recorder);
  set("ready", state.ready);
  set("sessionsRevision", state.sessions_revision);
  set("makingRevision", state.making_revision);
  known();
}

/** A frame is late by more than its way here if it comes first over a connection, again, or while paused. */
function show(frame) {
  if (isNewRun(frame)) {
    forget();
    fitScene(frame);
  }
  const isNew = frame.stamp !== get("frame")?.stamp;
  remember(frame, isNew && !joining && isPlaying(get("source")));
  joining = false;
  set("frame", frame);
}
