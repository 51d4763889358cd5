// SPDX-License-Identifier: Apache-2.0
#include "hull.h"

#include <Eigen/Dense>
#include <algorithm>
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

constexpr double least_thickness = 1e-6;  // of the size

// The largest distances from the first point, from the line to the farthest one, from the plane with the next.
void require_solid(const Matrix3Xd& points) {
  if (points.cols() < 4)
    throw std::invalid_argument(std::string("has ") + std::to_string(points.cols()) + " points, fewer than 4");
  if (!points.allFinite()) throw std::invalid_argument("has a point that is not finite");
  const Matrix3Xd arms = points.colwise() - points.col(0);
  Eigen::Index far = 0, wide = 0;
  const double size = arms.colwise().norm().maxCoeff(&far);
  if (!(size > 0.0)) throw std::invalid_argument("has all its points in one place");
  const Vector3d along = arms.col(far) / size;
  const Matrix3Xd across = arms - along * (along.transpose() * arms);
  const double width = across.colwise().norm().maxCoeff(&wide);
  if (width < least_thickness * size) throw std::invalid_argument("has all its points on a line");
  const Vector3d normal = along.cross(across.col(wide) / width);
  if ((normal.transpose() * arms).cwiseAbs().maxCoeff() < least_thickness * size)
    throw std::invalid_argument("has all its points in a plane");
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

  // Corners of each face as numbers of points, in order around it.
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

// Twice the area, along the normal.
Vector3d area_of(const Matrix3Xd& points, const std::vector<int>& face) {
  Vector3d area = Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < face.size(); ++i)
    area += (points.col(face[i]) - points.col(face[0])).cross(points.col(face[i + 1]) - points.col(face[0]));
  return area;
}

}  // namespace

Hull hull_of(const Matrix3Xd& points) {
  require_solid(points);
  const Vector3d middle = 0.5 * (points.rowwise().minCoeff() + points.rowwise().maxCoeff());
  const Matrix3Xd about = points.colwise() - middle;
  Hull hull;
  std::map<int, int> numbers;  // of corners, by the number of the point
  for (std::vector<int>& face : Qhull(about / about.cwiseAbs().maxCoeff()).faces()) {
    Vector3d area = area_of(about, face);
    if (area.dot(about.col(face[0])) < 0.0) {
      std::reverse(face.begin(), face.end());
      area = -area;
    }
    for (int& corner : face) corner = numbers.try_emplace(corner, static_cast<int>(numbers.size())).first->second;
    hull.faces.push_back({area.normalized(), std::move(face)});
  }
  hull.corners.resize(3, static_cast<Eigen::Index>(numbers.size()));
  for (const auto& [point, corner] : numbers) hull.corners.col(corner) = points.col(point);
  return hull;
}

// Tetrahedra between a point inside and the triangles of faces.
Inertia solid_of(const Hull& hull) {
  const Vector3d inside = hull.corners.rowwise().mean();
  double volume = 0.0;
  Vector3d first = Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (const HullFace& face : hull.faces)
    for (std::size_t i = 1; i + 1 < face.corners.size(); ++i) {
      Eigen::Matrix3d corners;
      corners << hull.corners.col(face.corners[0]), hull.corners.col(face.corners[i]),
          hull.corners.col(face.corners[i + 1]);
      corners.colwise() -= inside;
      const Vector3d sum = corners.rowwise().sum();
      const double share = corners.determinant() / 6.0;
      volume += share;
      first += share / 4.0 * sum;
      second += share / 20.0 * (corners * corners.transpose() + sum * sum.transpose());
    }
  const Vector3d center = first / volume;
  second -= volume * center * center.transpose();
  return {volume, inside + center, second.trace() * Eigen::Matrix3d::Identity() - second};
}

}  // namespace lockstep
