// ROS's costmap_2d inflation and the critics of dwa_local_planner as a library, without a node.
#include <base_local_planner/map_grid_cost_function.h>
#include <base_local_planner/obstacle_cost_function.h>
#include <base_local_planner/oscillation_cost_function.h>
#include <base_local_planner/simple_scored_sampling_planner.h>
#include <base_local_planner/simple_trajectory_generator.h>
#include <base_local_planner/twirling_cost_function.h>
#include <costmap_2d/inflation_layer.h>
#include <costmap_2d/layered_costmap.h>

#include <cmath>
#include <cstring>

using namespace base_local_planner;

namespace {

constexpr double forward_point_distance_m = 0.325;  // the default in DWAPlanner.cfg, as are the scales below

using Polygon = std::vector<geometry_msgs::Point>;

// corners: x, y of each corner [m].
Polygon polygon(const double *corners, int count) {
  Polygon points(count);
  for (int i = 0; i < count; ++i) {
    points[i].x = corners[2 * i];
    points[i].y = corners[2 * i + 1];
  }
  return points;
}

// Without a node there is no parameter server to ask.
struct InflationLayer : costmap_2d::InflationLayer {
  void onInitialize() override {
    current_ = enabled_ = true;
    matchSize();
  }
};

struct Inflation {
  Inflation(int columns, int rows, double resolution_m) : layers("map", false, true) {
    layers.resizeMap(columns, rows, resolution_m, 0.0, 0.0);
    layers.addPlugin(layer);
    layer->initialize(&layers, "inflation", nullptr);
  }

  costmap_2d::LayeredCostmap layers;
  boost::shared_ptr<InflationLayer> layer{new InflationLayer};
};

struct Dwa {
  Dwa(const unsigned char *costs, int columns, int rows, double resolution_m)
      : costmap(columns, rows, resolution_m, 0.0, 0.0) {
    std::memcpy(costmap.getCharMap(), costs, static_cast<size_t>(columns) * rows);
    // As DWAPlanner's constructor and reconfigure do it.
    front.setStopOnFailure(false);
    alignment.setStopOnFailure(false);
    path.setScale(0.6 * resolution_m);
    alignment.setScale(0.6 * resolution_m);
    goal.setScale(0.8 * resolution_m);
    front.setScale(0.8 * resolution_m);
    obstacles.setScale(0.01);
    obstacles.setSumScores(false);
    twirling.setScale(0.0);
    front.setXShift(forward_point_distance_m);
    alignment.setXShift(forward_point_distance_m);
    oscillation.setOscillationResetDist(0.05, 0.2);
    oscillation.resetOscillationFlags();
    std::vector<TrajectoryCostFunction *> critics{&oscillation, &obstacles, &front,   &alignment,
                                                  &path,        &goal,      &twirling};
    planner = SimpleScoredSamplingPlanner({&generator}, critics);
  }

  costmap_2d::Costmap2D costmap;
  SimpleTrajectoryGenerator generator;
  OscillationCostFunction oscillation;
  ObstacleCostFunction obstacles{&costmap};
  MapGridCostFunction path{&costmap}, goal{&costmap, 0.0, 0.0, true}, front{&costmap, 0.0, 0.0, true},
      alignment{&costmap};
  TwirlingCostFunction twirling;
  SimpleScoredSamplingPlanner planner;
  LocalPlannerLimits limits;
};

}  // namespace

extern "C" {

Inflation *inflation_new(int columns, int rows, double resolution_m, const double *corners, int count,
                         double radius_m, double decay_per_m) {
  auto *inflation = new Inflation(columns, rows, resolution_m);
  inflation->layer->setInflationParameters(radius_m, decay_per_m);
  inflation->layers.setFootprint(polygon(corners, count));
  return inflation;
}

// Inflate `lethal` (254 or 0) into `costs`.
void inflation_run(Inflation *inflation, const unsigned char *lethal, unsigned char *costs) {
  costmap_2d::Costmap2D &map = *inflation->layers.getCostmap();
  const size_t cells = static_cast<size_t>(map.getSizeInCellsX()) * map.getSizeInCellsY();
  std::memcpy(map.getCharMap(), lethal, cells);
  inflation->layer->updateCosts(map, 0, 0, map.getSizeInCellsX(), map.getSizeInCellsY());
  std::memcpy(costs, map.getCharMap(), cells);
}

Dwa *dwa_new(const unsigned char *costs, int columns, int rows, double resolution_m, double horizon_s,
             double step_s, const double *limits) {
  auto *dwa = new Dwa(costs, columns, rows, resolution_m);
  dwa->generator.setParameters(horizon_s, step_s, step_s, true, step_s);
  // v and w, greatest; their accelerations.
  dwa->limits = LocalPlannerLimits(limits[0], 0.0, limits[0], 0.0, 0.0, 0.0, limits[1], 0.0, limits[2], 0.0,
                                   limits[3], limits[2], 0.1, 0.1);
  dwa->obstacles.setParams(limits[0], 0.2, 0.25);
  return dwa;
}

// One cycle: prepare the critics and score all samples, whose number is returned. pose: x, y, theta.
int dwa_run(Dwa *dwa, const double *pose, double v_m_s, int v_samples, int w_samples, const double *corners,
            int corner_count, const double *points, int count) {
  std::vector<geometry_msgs::PoseStamped> plan(count);
  for (int i = 0; i < count; ++i) {
    plan[i].pose.position.x = points[2 * i];
    plan[i].pose.position.y = points[2 * i + 1];
    plan[i].pose.orientation.w = 1.0;
  }
  dwa->obstacles.setFootprint(polygon(corners, corner_count));
  dwa->path.setTargetPoses(plan);
  dwa->goal.setTargetPoses(plan);
  dwa->alignment.setTargetPoses(plan);
  auto front = plan;
  geometry_msgs::Point &end = front.back().pose.position;
  const double angle = std::atan2(end.y - pose[1], end.x - pose[0]);
  const Eigen::Vector3f goal(end.x, end.y, 0.0F);
  end.x += forward_point_distance_m * std::cos(angle);
  end.y += forward_point_distance_m * std::sin(angle);
  dwa->front.setTargetPoses(front);
  dwa->generator.initialise(Eigen::Vector3f(pose[0], pose[1], pose[2]), Eigen::Vector3f(v_m_s, 0.0F, 0.0F),
                            goal, &dwa->limits, Eigen::Vector3f(v_samples, 1.0F, w_samples), true);
  Trajectory found;
  std::vector<Trajectory> all;
  dwa->planner.findBestTrajectory(found, &all);
  return static_cast<int>(all.size());
}
}
