// A place in NiceGUI's page for one of our own parts.

import { begin, parts } from "thumper-dashboard";

export default {
  template: "<div></div>",
  props: { name: String, options: Object },
  mounted() {
    if (this.name in parts) parts[this.name](this.$el, this.options ?? {});
    begin();
  },
};
