// SPDX-License-Identifier: Apache-2.0
#include "hull.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>

#include "libqhull_r/qhull_ra.h"

namespace lockstep {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

// Twice the area, along the normal.
Vector3d area_of(const Matrix3Xd& points, const std::vector<int>& face) {
  Vector3d area = Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < face.size(); ++i)
    area += (points.col(face[i]) - points.col(face[0])).cross(points.col(face[i + 1]) - points.col(face[0]));
  return area;
}

// Owns qhull's memory, and the file into which it writes complaints.
class Qhull {
 public:
  explicit Qhull(Matrix3Xd points) : points_(std::move(points)) {
    qh_zero(&qh_, nullptr);
    errors_ = open_memstream(&text_, &length_);
    const std::string command = "qhull C-1e-6";  // merges what lies in one plane: points are of size 1
    const int failed = qh_new_qhull(&qh_, 3, static_cast<int>(points_.cols()), points_.data(), False,
                                    const_cast<char*>(command.c_str()), nullptr, errors_);
    std::fflush(errors_);
    if (failed) {
      const std::string said(text_, std::min<std::size_t>(length_, 200));
      free_all();
      throw std::invalid_argument("has no hull by qhull: " + said.substr(0, said.find('\n')));
    }
  }
  ~Qhull() { free_all(); }
  Qhull(const Qhull&) = delete;
  Qhull& operator=(const Qhull&) = delete;

  // Corners of each face as numbers of points, to the left about the normal that points outwards.
  std::vector<std::vector<int>> faces() {
    std::vector<std::vector<int>> found;
    qhT* const qh = &qh_;  // the name that qhull's macros want
    facetT* facet;
    FORALLfacets {
      found.emplace_back();
      setT* const around = qh_facet3vertex(qh, facet);
      vertexT *vertex, **vertexp;
      FOREACHvertex_(around) found.back().push_back(qh_pointid(qh, vertex->point));
      qh_settempfree(qh, const_cast<setT**>(&around));
      const Vector3d outwards = Eigen::Map<const Vector3d>(facet->normal);
      if (area_of(points_, found.back()).dot(outwards) < 0.0) std::reverse(found.back().begin(), found.back().end());
    }
    return found;
  }

 private:
  void free_all() {
    qh_freeqhull(&qh_, !qh_ALL);
    int left = 0, blocks = 0;
    qh_memfreeshort(&qh_, &left, &blocks);
    std::fclose(errors_);
    std::free(text_);
  }

  qhT qh_;
  Matrix3Xd points_;
  std::FILE* errors_;
  char* text_ = nullptr;
  std::size_t length_ = 0;
};

}  // namespace

std::array<Eigen::Index, 4> points_apart(const Matrix3Xd& points) {
  constexpr double least_thickness = 1e-6;  // of the size
  if (points.cols() < 4)
    throw std::invalid_argument(std::string("has ") + std::to_string(points.cols()) + " points, fewer than 4");
  if (!points.allFinite()) throw std::invalid_argument("has a point that is not finite");
  const Matrix3Xd arms = points.colwise() - points.col(0);
  Eigen::Index far = 0, wide = 0, high = 0;
  const double size = arms.colwise().norm().maxCoeff(&far);
  if (!(size > 0.0)) throw std::invalid_argument("has all its points in one place");
  const Vector3d along = arms.col(far) / size;
  const Matrix3Xd across = arms - along * (along.transpose() * arms);
  const double width = across.colwise().norm().maxCoeff(&wide);
  if (width < least_thickness * size) throw std::invalid_argument("has all its points on a line");
  const Vector3d normal = along.cross(across.col(wide) / width);
  if ((normal.transpose() * arms).cwiseAbs().maxCoeff(&high) < least_thickness * size)
    throw std::invalid_argument("has all its points in a plane");
  return {0, far, wide, high};
}

Hull hull_of(const Matrix3Xd& points) {
  points_apart(points);
  const Vector3d middle = 0.5 * (points.rowwise().minCoeff() + points.rowwise().maxCoeff());
  const Matrix3Xd about = points.colwise() - middle;
  Hull hull;
  std::map<int, int> numbers;  // of corners, by the number of the point
  for (std::vector<int>& face : Qhull(about / about.cwiseAbs().maxCoeff()).faces()) {
    const Vector3d area = area_of(about, face);
    for (int& corner : face) corner = numbers.try_emplace(corner, static_cast<int>(numbers.size())).first->second;
    hull.faces.push_back({area.normalized(), std::move(face)});
  }
  hull.corners.resize(3, static_cast<Eigen::Index>(numbers.size()));
  for (const auto& [point, corner] : numbers) hull.corners.col(corner) = points.col(point);
  return hull;
}

Inertia solid_of(const Hull& hull) {
  TetrahedronSum sum(hull.corners.rowwise().mean());
  for (const HullFace& face : hull.faces)
    for (std::size_t i = 1; i + 1 < face.corners.size(); ++i)
      sum.add(hull.corners(Eigen::all, std::array{face.corners[0], face.corners[i], face.corners[i + 1]}));
  return sum.inertia();
}

// (M158)
void TetrahedronSum::add(const Eigen::Matrix3d& triangle, bool is_absolute) {
  const Eigen::Matrix3d corners = triangle.colwise() - apex_;
  const Vector3d sum = corners.rowwise().sum();
  const double signed_volume = corners.determinant() / 6.0;
  const double volume = is_absolute ? std::abs(signed_volume) : signed_volume;
  volume_ += volume;
  first_ += volume / 4.0 * sum;
  second_ += volume / 20.0 * (corners * corners.transpose() + sum * sum.transpose());
}

Inertia TetrahedronSum::inertia() const {
  const Vector3d center = first_ / volume_;
  const Eigen::Matrix3d second = second_ - volume_ * center * center.transpose();
  return {volume_, apex_ + center, second.trace() * Eigen::Matrix3d::Identity() - second};
}

}  // namespace lockstep
