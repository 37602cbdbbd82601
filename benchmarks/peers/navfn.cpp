// ROS's navfn as a library, without ROS: what NavfnROS::makePlan does for one plan.
#include <navfn/navfn.h>

extern "C" {

navfn::NavFn *navfn_new(int columns, int rows) { return new navfn::NavFn(columns, rows); }

void navfn_delete(navfn::NavFn *planner) { delete planner; }

// Plan from start to goal, each column and row; return the number of path points. costs is a costmap_2d,
// unknown cells block.
int navfn_plan(navfn::NavFn *planner, const unsigned char *costs, int columns, int rows, int *start,
               int *goal, int use_astar) {
  planner->setNavArr(columns, rows);
  planner->setCostmap(costs, true, false);
  planner->setGoal(start);  // as makePlan does: the wave starts at the robot
  planner->setStart(goal);
  if (use_astar) {
    planner->calcNavFnAstar();
  } else {
    planner->calcNavFnDijkstra(true);  // stop at the goal
  }
  return planner->getPathLen();
}

const float *navfn_x(navfn::NavFn *planner) { return planner->getPathX(); }
const float *navfn_y(navfn::NavFn *planner) { return planner->getPathY(); }
}
