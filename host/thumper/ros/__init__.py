"""ROS 2 messages and topics: conversion, codec, text."""
