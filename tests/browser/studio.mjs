// Foxglove as a page: everything it would keep in a browser's storage is kept in memory, and nothing is sent home.
/* global App, FoxgloveWebSocketDataSourceFactory, React, ReactDOM, RemoteDataSourceFactory, initI18n */

const SETTINGS = {
  colorScheme: "dark",
  launchPreference: "web",
  hideSignInPrompt: true,
  "telemetry.telemetryEnabled": false,
  "telemetry.crashReportingEnabled": false,
  "ui.open-dialog-startup": false,
  timezone: "UTC",
};

const settings = {
  get: (key) => SETTINGS[key],
  set: async (key, value) => {
    SETTINGS[key] = value;
  },
  addChangeListener: () => {},
  removeChangeListener: () => {},
};

/** The layout under test, the only one there is. */
function storageOf(data) {
  const layouts = new Map();
  const baseline = { data, savedAt: new Date(0).toISOString() };
  layouts.set("shipped", { id: "shipped", name: "shipped", permission: "CREATOR_WRITE", baseline });
  return {
    list: async () => [...layouts.values()],
    get: async (_namespace, id) => layouts.get(id),
    put: async (_namespace, layout) => {
      layouts.set(layout.id, layout);
      return layout;
    },
    delete: async (_namespace, id) => layouts.delete(id),
    importLayouts: async () => {},
  };
}

const layout = await (await fetch("/layout.json")).json();
const onboarding = { settingsTooltipShownForPanelTypes: ["3D"] };
localStorage.setItem("studio.profile-data", JSON.stringify({ currentLayoutId: "shipped", onboarding }));
await initI18n();
ReactDOM.render(
  React.createElement(App, {
    deepLinks: [location.href],
    appConfiguration: settings,
    dataSources: [new RemoteDataSourceFactory(), new FoxgloveWebSocketDataSourceFactory()],
    layoutStorage: storageOf(layout),
    extensionLoaders: [],
    enableGlobalCss: true,
  }),
  document.getElementById("root"),
);
