// Look-ups of a Plan. SPDX-License-Identifier: Apache-2.0
#include "lockstep/plan.h"

#include "fields.h"
#include "identity.h"
#include "lockstep/error.h"
#include "program.h"

namespace lockstep {

const Program& program_of(const Plan& plan) { return *plan.program_; }

const Model& Plan::model() const { return program_->model; }
const StepSettings& Plan::settings() const { return program_->settings; }
std::uint64_t Plan::hash() const { return identity_of(*program_).plan; }
std::uint64_t Plan::model_hash() const { return identity_of(*program_).model; }
Method Plan::method() const { return program_->method; }
Integrator Plan::integrator() const { return program_->integrator; }
std::vector<double> Plan::stage_times() const { return program_->stage_times; }
int Plan::dofs() const { return program_->f64.joints; }
int Plan::couplings() const { return program_->f64.couplings; }
const std::vector<std::string>& Plan::root_names() const { return program_->root_names; }
const std::vector<PlanTree>& Plan::trees() const { return program_->trees; }
const std::vector<PlanContact>& Plan::contacts() const { return program_->plan_contacts; }
const std::vector<PlanLoop>& Plan::loops() const { return program_->plan_loops; }
const std::vector<int>& Plan::loop_dependent_dofs() const { return program_->loop_dependent_dofs; }
const std::vector<std::string>& Plan::dof_names() const { return program_->dof_names; }
const std::vector<std::string>& Plan::row_names() const { return program_->row_names; }
const std::vector<int>& Plan::redundant_couplings() const { return program_->redundant; }
const std::vector<int>& Plan::eliminated_dofs() const { return program_->eliminated; }

const std::vector<int>& Plan::independent_dofs() const { return program_->independent_dofs; }
const std::vector<int>& Plan::follower_dofs() const { return program_->follower_dofs; }
const std::vector<int>& Plan::driven_dofs() const { return program_->driven_dofs; }
const std::vector<LockedJoints>& Plan::locked_joints() const { return program_->locked; }
std::vector<Obstacle> Plan::obstacles() const { return {program_->obstacles.begin(), program_->obstacles.end()}; }

const Following& Plan::following(int dof) const {
  if (dof < 0 || dof >= dofs())
    throw UsageError("dof " + std::to_string(dof), "is not part of the plan",
                     "give 0 to " + std::to_string(dofs() - 1));
  return program_->following[dof];
}

int Plan::leader(int dof) const {
  const std::vector<Following::Leader>& leaders = following(dof).leaders;
  return leaders.size() == 1 ? leaders[0].dof : -1;
}

namespace {

template <class Elements, class Name>
int find(const Elements& elements, const std::string& wanted, Name name, const char* kind, const char* remedy) {
  for (std::size_t i = 0; i < elements.size(); ++i)
    if (name(elements[i]) == wanted) return static_cast<int>(i);
  throw UsageError(std::string(kind) + " '" + wanted + "'", "is not part of the plan", remedy);
}

}  // namespace

int Plan::dof(const std::string& joint) const {
  return find(
      program_->dof_names, joint, [](const std::string& n) -> const std::string& { return n; }, "dof",
      "see Plan::dof_names()");
}
int Plan::link(const std::string& wanted) const {
  return find(
      program_->model.links, wanted, [](const Link& l) -> const std::string& { return l.name; }, "link",
      "see Model::links");
}
int Plan::site(const std::string& wanted) const {
  return find(
      program_->model.sites, wanted, [](const Site& s) -> const std::string& { return s.name; }, "site",
      "see Model::sites");
}

int Plan::pose(const std::string& wanted) const {
  return find(
      program_->model.poses, wanted, [](const NamedPose& p) -> const std::string& { return p.name; }, "pose",
      "see Model::poses");
}

int Plan::contact(const std::string& wanted) const {
  return find(
      program_->plan_contacts, wanted, [](const PlanContact& c) -> const std::string& { return c.name; }, "contact",
      "see Plan::contacts()");
}

const std::vector<std::string>& Plan::parameter_row_names(Parameter parameter) const {
  parameter_rows(parameter);
  return fields_of(*program_).names[static_cast<unsigned>(parameter)];
}

int Plan::parameter_rows(Parameter parameter) const {
  if (const int rows = rows_of(program_->f64, parameter); rows >= 0) return rows;
  throw UsageError("field " + std::to_string(static_cast<unsigned>(parameter)), "is none of the enumerators",
                   "give one of Parameter");
}

}  // namespace lockstep
