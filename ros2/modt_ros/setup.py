"""The package modt_ros, for colcon."""

from setuptools import setup

NAME = "modt_ros"
SHARE = f"share/{NAME}"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/launch", ["launch/modt.launch.py"]),
        (f"{SHARE}/config", ["config/modt.rviz", "config/foxglove.json"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="The maintainers of modt",
    maintainer_email="modt@localhost",
    description="modt as a node of ROS 2",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"modt = {NAME}.node:main"]},
)
