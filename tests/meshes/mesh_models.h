// What tests of meshes in robot files share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "lockstep/error.h"
#include "lockstep/import.h"

namespace lockstep::meshes {

using std::string;

/// Corners of a collider's hull in its link.
inline Eigen::Matrix3Xd placed(const Collider& collider) { return collider.pose * collider.shape.points; }

/// The error's element, rule and remedy have these words.
template <class Refused = ImportError>
void expect_refused(const std::function<Import()>& read, const string& element, const string& rule,
                    const string& remedy = "") {
  try {
    read();
    ADD_FAILURE() << "read, in place of: " << rule;
  } catch (const Refused& error) {
    EXPECT_NE(error.element().find(element), string::npos) << error.what();
    EXPECT_NE(error.rule().find(rule), string::npos) << error.what();
    EXPECT_NE(error.remedy().find(remedy), string::npos) << error.what();
  }
}

}  // namespace lockstep::meshes
