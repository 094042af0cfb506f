import { mount } from "svelte";
import "./theme.css";
import "./base.css";
import App from "./App.svelte";

const host = document.getElementById("app");
if (host) mount(App, { target: host });
