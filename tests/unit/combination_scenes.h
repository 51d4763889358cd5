// The features that stand beside each other, and scenes of them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep::combinations {

/// Scenes are made of features, which change the model or the settings.
struct Feature {
  const char* name;
  void (*add)(Model&, StepSettings&);
};

/// By name, which must be that of a joint.
Joint& joint_of(Model& model, const char* name);

/// Three sliders, to which features are added.
Model arm();

/// Of each the features. The first has none.
const std::vector<std::vector<Feature>>& all_scenes();

/// A model with its settings.
struct Scene {
  Model model = arm();
  StepSettings settings;
  std::string name;

  explicit Scene(const std::vector<Feature>& features) {
    for (const Feature& feature : features) {
      feature.add(model, settings);
      name += (name.empty() ? "" : " + ") + std::string(feature.name);
    }
  }
  bool has(const char* feature) const { return name.find(feature) != std::string::npos; }
};

}  // namespace lockstep::combinations
