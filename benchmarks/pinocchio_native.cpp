// Pinocchio's own C++ over many states, built for this processor: the fastest it can be. Reads a model (see `peers.py`) and a
// number of states, then for every function named on a line of standard input prints the nanoseconds per state that it took.
#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <chrono>
#include <fstream>
#include <iostream>
#include <string>

namespace pin = pinocchio;

static pin::Model read(const char *path)
{
    std::ifstream in(path);
    pin::Model model;
    int count;
    in >> count;
    for (int k = 0; k < count; ++k) {
        std::string kind;
        std::size_t parent;
        Eigen::Vector3d axis, p, center;
        Eigen::Matrix3d R, inertia;
        double mass;
        in >> kind >> parent;
        for (int i = 0; i < 3; ++i) in >> axis[i];
        for (int i = 0; i < 9; ++i) in >> R(i / 3, i % 3);
        for (int i = 0; i < 3; ++i) in >> p[i];
        in >> mass;
        for (int i = 0; i < 3; ++i) in >> center[i];
        for (int i = 0; i < 9; ++i) in >> inertia(i / 3, i % 3);
        const pin::SE3 placement(R, p);
        const std::string name = "j" + std::to_string(k);
        pin::JointIndex id;
        if (kind == "free") id = model.addJoint(parent, pin::JointModelFreeFlyer(), placement, name);
        else if (kind == "RX") id = model.addJoint(parent, pin::JointModelRX(), placement, name);
        else if (kind == "RY") id = model.addJoint(parent, pin::JointModelRY(), placement, name);
        else if (kind == "RZ") id = model.addJoint(parent, pin::JointModelRZ(), placement, name);
        else if (kind == "R") id = model.addJoint(parent, pin::JointModelRevoluteUnaligned(axis), placement, name);
        else if (kind == "PX") id = model.addJoint(parent, pin::JointModelPX(), placement, name);
        else if (kind == "PY") id = model.addJoint(parent, pin::JointModelPY(), placement, name);
        else if (kind == "PZ") id = model.addJoint(parent, pin::JointModelPZ(), placement, name);
        else id = model.addJoint(parent, pin::JointModelPrismaticUnaligned(axis), placement, name);
        model.appendBodyToJoint(id, pin::Inertia(mass, center, inertia));
    }
    return model;
}

int main(int, char **arguments)
{
    const pin::Model model = read(arguments[1]);
    const int states = std::stoi(arguments[2]);
    pin::Data data(model);
    Eigen::MatrixXd Q(model.nq, states), V = Eigen::MatrixXd::Random(model.nv, states), T = Eigen::MatrixXd::Random(model.nv, states);
    Eigen::VectorXd limit = Eigen::VectorXd::Constant(model.nq, 1.0), q(model.nq);
    for (int k = 0; k < states; ++k) Q.col(k) = pin::randomConfiguration(model, -limit, limit);
    Eigen::MatrixXd result(model.nv, states), masses(model.nv * model.nv, states);
    std::string line;
    std::cout << "ready" << std::endl;
    double sink = 0.0;
    while (std::getline(std::cin, line)) {
        const auto begin = std::chrono::steady_clock::now();
        for (int k = 0; k < states; ++k) {
            if (line == "forward_dynamics") result.col(k) = pin::aba(model, data, Q.col(k), V.col(k), T.col(k), pin::Convention::LOCAL);
            else if (line == "inverse_dynamics") result.col(k) = pin::rnea(model, data, Q.col(k), V.col(k), T.col(k));
            else if (line == "mass_matrix, kept") {
                const auto &M = pin::crba(model, data, Q.col(k), pin::Convention::LOCAL);
                Eigen::Map<Eigen::MatrixXd>(masses.col(k).data(), model.nv, model.nv) = M.selfadjointView<Eigen::Upper>();
            }
            else sink += pin::crba(model, data, Q.col(k), pin::Convention::LOCAL)(0, 0);
        }
        const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - begin;
        std::cout << taken.count() / states << " " << (sink + result(0, 0) != 0.0) << std::endl;
    }
}
