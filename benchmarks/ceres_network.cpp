// A ranging network solved by Ceres: DENSE_SCHUR, targets eliminated first, analytic Jacobian, one thread.
//
// ceres_network PROBLEM ANSWER ROUNDS
// PROBLEM: int64 stations, targets, ranges, parameters a station (3, or 5: x y z zero scale), stations with a prior;
//   then doubles stations (S, 3), targets (T, 3); int64 station (m), target (m); doubles distance (m), root weight (m);
//   then, of each prior, int64 station (k); doubles value (k, 3), root weight (k) of each coordinate.
// Writes the answer, stations (S, p) and targets (T, 3), as doubles, and prints a line a round: processor seconds in
// Solve alone, steps, final sum of squares. The first trust region is so large that the steps are those of Gauss-Newton.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <vector>

#include <ceres/ceres.h>

template <int P>
class Range : public ceres::SizedCostFunction<1, P, 3> {
 public:
  Range(double distance, double root) : distance_(distance), root_(root) {}

  bool Evaluate(double const* const* p, double* residual, double** jacobian) const override {
    const double x = p[1][0] - p[0][0], y = p[1][1] - p[0][1], z = p[1][2] - p[0][2];
    const double length = std::sqrt(x * x + y * y + z * z);
    double zero = 0.0, stretch = 1.0;
    if constexpr (P == 5) {
      zero = p[0][3];
      stretch = 1.0 + p[0][4];
    }
    residual[0] = root_ * (stretch * length + zero - distance_);
    if (jacobian == nullptr) return true;
    const double f = root_ * stretch / length;
    if (double* j = jacobian[0]) {
      j[0] = -f * x, j[1] = -f * y, j[2] = -f * z;
      if constexpr (P == 5) j[3] = root_, j[4] = root_ * length;
    }
    if (double* j = jacobian[1]) j[0] = f * x, j[1] = f * y, j[2] = f * z;
    return true;
  }

 private:
  double distance_, root_;
};

template <int P>
class Prior : public ceres::SizedCostFunction<3, P> {
 public:
  Prior(const double* value, double root) : value_(value), root_(root) {}

  bool Evaluate(double const* const* p, double* residual, double** jacobian) const override {
    for (int i = 0; i < 3; ++i) residual[i] = root_ * (p[0][i] - value_[i]);
    if (jacobian == nullptr || jacobian[0] == nullptr) return true;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < P; ++k) jacobian[0][i * P + k] = i == k ? root_ : 0.0;
    return true;
  }

 private:
  const double* value_;
  double root_;
};

template <typename T>
std::vector<T> read(std::ifstream& in, std::int64_t n) {
  std::vector<T> out(n);
  in.read(reinterpret_cast<char*>(out.data()), n * sizeof(T));
  return out;
}

struct Network {
  std::int64_t stations, targets, ranges, width, priors;
  std::vector<double> x, t, distance, root, value, prior_root;
  std::vector<std::int64_t> station, target, prior_station;
};

template <int P>
void solve(const Network& n, std::vector<double>& x, std::vector<double>& t) {
  ceres::Problem problem;
  auto* order = new ceres::ParameterBlockOrdering;
  for (std::int64_t i = 0; i < n.ranges; ++i)
    problem.AddResidualBlock(new Range<P>(n.distance[i], n.root[i]), nullptr, &x[P * n.station[i]], &t[3 * n.target[i]]);
  for (std::int64_t i = 0; i < n.priors; ++i)
    problem.AddResidualBlock(new Prior<P>(&n.value[3 * i], n.prior_root[i]), nullptr, &x[P * n.prior_station[i]]);
  for (std::int64_t i = 0; i < n.targets; ++i) order->AddElementToGroup(&t[3 * i], 0);
  for (std::int64_t i = 0; i < n.stations; ++i) order->AddElementToGroup(&x[P * i], 1);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering.reset(order);
  options.num_threads = 1;
  options.initial_trust_region_radius = 1e12;
  options.function_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  const std::clock_t start = std::clock();
  ceres::Solve(options, &problem, &summary);
  const double taken = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  std::printf("%.9f %d %.9f\n", taken, summary.num_successful_steps, 2.0 * summary.final_cost);
}

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  std::ifstream in(argv[1], std::ios::binary);
  const auto head = read<std::int64_t>(in, 5);
  Network n{head[0], head[1], head[2], head[3], head[4], {}, {}, {}, {}, {}, {}, {}, {}, {}};
  n.x = read<double>(in, 3 * n.stations);
  n.t = read<double>(in, 3 * n.targets);
  n.station = read<std::int64_t>(in, n.ranges);
  n.target = read<std::int64_t>(in, n.ranges);
  n.distance = read<double>(in, n.ranges);
  n.root = read<double>(in, n.ranges);
  n.prior_station = read<std::int64_t>(in, n.priors);
  n.value = read<double>(in, 3 * n.priors);
  n.prior_root = read<double>(in, n.priors);
  if (!in) return 1;
  std::vector<double> x, t;
  for (int round = 0; round < std::atoi(argv[3]); ++round) {
    x.assign(n.width * n.stations, 0.0);
    for (std::int64_t i = 0; i < n.stations; ++i)
      for (int k = 0; k < 3; ++k) x[n.width * i + k] = n.x[3 * i + k];
    t = n.t;
    n.width == 5 ? solve<5>(n, x, t) : solve<3>(n, x, t);
  }
  std::ofstream out(argv[2], std::ios::binary);
  out.write(reinterpret_cast<const char*>(x.data()), x.size() * sizeof(double));
  out.write(reinterpret_cast<const char*>(t.data()), t.size() * sizeof(double));
  return out ? 0 : 1;
}
