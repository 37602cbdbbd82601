// OpenSLAM's gmapping as a library, with the options of ROS's slam_gmapping.
#include <gmapping/gridfastslam/gridslamprocessor.h>

#include <fstream>
#include <iostream>
#include <vector>

using namespace GMapping;

namespace {

struct Mapper {
  std::ofstream nowhere{"/dev/null"};
  RangeSensor *sensor = nullptr;
  GridSlamProcessor processor{nowhere};
  std::vector<double> ranges_m;
};

}  // namespace

extern "C" {

// Angles of the beams [rad], the lidar ahead of the base [m], its range [m], first odometry x, y [m], theta
// [rad].
Mapper *gmapping_new(int particles, const double *angles_rad, int beams, double ahead_m, double range_m,
                     const double *odometry) {
  std::cerr.setstate(std::ios_base::failbit);  // it writes a line for each scan
  sampleGaussian(1, 1);
  srand48(1);
  auto *mapper = new Mapper;
  const double step_rad = (angles_rad[beams - 1] - angles_rad[0]) / (beams - 1);
  mapper->sensor = new RangeSensor("FLASER", beams, step_rad, OrientedPoint(ahead_m, 0.0, 0.0), 0.0, range_m);
  for (int i = 0; i < beams; ++i) {
    mapper->sensor->beams()[i].pose.theta = angles_rad[i];
  }
  mapper->sensor->updateBeamsLookup();
  SensorMap sensors;
  sensors.insert(std::make_pair(mapper->sensor->getName(), mapper->sensor));
  GridSlamProcessor &processor = mapper->processor;
  processor.setSensorMap(sensors);
  processor.setMatchingParameters(range_m, range_m, 0.05, 1, 0.05, 0.05, 5, 0.075, 3.0, 0);
  processor.setMotionModelParameters(0.1, 0.2, 0.1, 0.2);
  processor.setUpdateDistances(1.0, 0.5, 0.5);
  processor.setUpdatePeriod(-1.0);
  processor.setgenerateMap(false);
  processor.GridSlamProcessor::init(particles, -100.0, -100.0, 100.0, 100.0, 0.05,
                                    OrientedPoint(odometry[0], odometry[1], odometry[2]));
  processor.setllsamplerange(0.01);
  processor.setllsamplestep(0.01);
  processor.setlasamplerange(0.005);
  processor.setlasamplestep(0.005);
  processor.setminimumScore(0.0);
  mapper->ranges_m.resize(beams);
  return mapper;
}

// Add a scan: ranges [m], those without an echo as the lidar's range; odometry x, y [m], theta [rad]. Write
// the pose of the best particle; return 1 if the scan was matched.
int gmapping_update(Mapper *mapper, const double *ranges_m, const double *odometry, double time_s,
                    double *pose) {
  mapper->ranges_m.assign(ranges_m, ranges_m + mapper->ranges_m.size());
  RangeReading reading(mapper->ranges_m.size(), mapper->ranges_m.data(), mapper->sensor, time_s);
  reading.setPose(OrientedPoint(odometry[0], odometry[1], odometry[2]));
  const bool is_matched = mapper->processor.processScan(reading);
  const auto &best = mapper->processor.getParticles()[mapper->processor.getBestParticleIndex()];
  pose[0] = best.pose.x;
  pose[1] = best.pose.y;
  pose[2] = best.pose.theta;
  return is_matched;
}
}
