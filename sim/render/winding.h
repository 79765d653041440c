// What is inside of a mesh.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "sim/render/scene.h"

namespace lightstage::sim {

// How often the mesh goes around a point: 1 within a closed mesh, 0 outside of it, −1 in a room whose walls face inwards, something in
// between near an open one (Jacobson, Kavan, Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers",
// 2013).
double WindingNumber(const Mesh& mesh, const Eigen::Vector3d& point);

// A number for each vertex, counted up from 0: those at the same place have the same, for creases have several.
std::vector<uint32_t> Places(const Mesh& mesh);

// The parts of a closed mesh that have no vertex in common.
class Shells {
 public:
  struct Shell {
    std::vector<uint32_t> triangles;
    Eigen::AlignedBox3d box;
  };
  explicit Shells(const Mesh& mesh);
  const std::vector<Shell>& all() const { return shells_; }
  uint32_t Of(uint32_t triangle) const { return of_[triangle]; }
  const std::vector<uint32_t>& places() const { return places_; }

  // As above. A closed shell does not go around what is outside of its box.
  int WindingNumber(const Eigen::Vector3d& point) const;

 private:
  const Mesh& mesh_;
  std::vector<uint32_t> places_;  // of the mesh's vertices
  std::vector<uint32_t> of_;      // a triangle's shell
  std::vector<Shell> shells_;
};

}  // namespace lightstage::sim
