// LaMa's Slam2D (a single hypothesis) and PFSlam2D (particles) as a library.
#include <lama/pf_slam2d.h>
#include <lama/slam2d.h>

namespace {

struct Mapper {
  std::unique_ptr<lama::Slam2D> single;
  std::unique_ptr<lama::PFSlam2D> particles;
  bool is_first = true;
};

}  // namespace

extern "C" {

// 0 particles: a single hypothesis. gate: the way [m] and the turn [rad] between two scans that are matched.
Mapper *lama_new(int particles, double gate) {
  auto *mapper = new Mapper;
  if (particles == 0) {
    lama::Slam2D::Options options;
    options.trans_thresh = options.rot_thresh = gate;
    mapper->single = std::make_unique<lama::Slam2D>(options);
  } else {
    lama::PFSlam2D::Options options;
    options.particles = particles;
    options.trans_thresh = options.rot_thresh = gate;
    options.seed = 1;
    options.threads = -1;  // none but this one
    mapper->particles = std::make_unique<lama::PFSlam2D>(options);
  }
  return mapper;
}

// Add a scan: points [m] in the base frame, the lidar ahead of it [m], odometry x, y [m], theta [rad]. Write
// the pose; return 1 if the scan was matched.
int lama_update(Mapper *mapper, const double *points_m, int count, double ahead_m, const double *odometry,
                double time_s, double *pose) {
  lama::PointCloudXYZ::Ptr cloud(new lama::PointCloudXYZ);
  cloud->sensor_origin_ = lama::Vector3d(ahead_m, 0.0, 0.0);
  cloud->sensor_orientation_ = lama::Quaterniond(1.0, 0.0, 0.0, 0.0);
  cloud->points.reserve(count);
  for (int i = 0; i < count; ++i) {
    cloud->points.push_back(lama::Vector3d(points_m[2 * i] - ahead_m, points_m[2 * i + 1], 0.0));
  }
  const lama::Pose2D odom(odometry[0], odometry[1], odometry[2]);
  if (mapper->is_first) {
    mapper->is_first = false;
    if (mapper->single) {
      mapper->single->setPose(odom);
    } else {
      mapper->particles->setPrior(odom);
    }
  }
  const bool is_matched = mapper->single ? mapper->single->update(cloud, odom, time_s)
                                         : mapper->particles->update(cloud, odom, time_s);
  const lama::Pose2D now = mapper->single ? mapper->single->getPose() : mapper->particles->getPose();
  pose[0] = now.x();
  pose[1] = now.y();
  pose[2] = now.rotation();
  return is_matched;
}
}
