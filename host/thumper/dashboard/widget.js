// Vue component that mounts one of our own widgets into NiceGUI's page.

import { startPage, widgets } from "thumper-dashboard";

export default {
  template: "<div></div>",
  props: { name: String, options: Object },
  mounted() {
    if (this.name in widgets) widgets[this.name](this.$el, this.options ?? {});
    startPage();
  },
};
