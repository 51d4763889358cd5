// Sites where loops and tendons need points. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/model.h"

namespace lockstep::exporter::mjcf {

/// The link that is the world; empty if there is none.
std::string world_link(const Model& model);

/// The name of a site at a point of a link, or of the world for an empty name; empty if there is none.
std::string find_site(const Model& model, const std::string& link, const Eigen::Vector3d& at);

/// The same, of one that this adds if there is none: `wanted`, or a name like it that is free.
std::string site_at(const std::string& link, const Eigen::Vector3d& at, const std::string& wanted, Model& model);

}  // namespace lockstep::exporter::mjcf
