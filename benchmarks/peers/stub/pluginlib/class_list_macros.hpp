// Debian has no pluginlib: the layer is linked.
#pragma once
#define PLUGINLIB_EXPORT_CLASS(...)
